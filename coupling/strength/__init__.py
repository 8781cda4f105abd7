"""Strength of a response: what its stresses, contacts and impacts do to the parts over time."""
