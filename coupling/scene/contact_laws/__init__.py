"""Contact laws: what a gap does when it closes. Each is one class in a file of its own (law.ContactLaw says how)."""
