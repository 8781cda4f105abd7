"""The event-driven engine: closed-form flow from event to event."""
