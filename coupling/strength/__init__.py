"""Strength: what motions mean for materials. Begin with `contact_numbers.contact`."""
