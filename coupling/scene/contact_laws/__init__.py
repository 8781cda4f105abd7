"""Contact laws: the behaviour of a gap that closes. Each is one class in a file of its own (law.ContactLaw)."""
