"""Error against time of every method and of other programs."""
