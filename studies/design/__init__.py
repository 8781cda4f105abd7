"""From a case and an envelope to one device, with what it must hold."""
