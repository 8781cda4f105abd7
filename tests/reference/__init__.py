"""Independent solutions: DOP853 with event location, multiprecision propagators, closed forms of impacts and orbits."""
