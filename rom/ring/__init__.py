"""Reduced rings: the data of one sector in waves around the ring, or sector by sector, with deviations by sector."""
