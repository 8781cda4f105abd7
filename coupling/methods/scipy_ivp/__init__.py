"""`solver.method = "solve_ivp"`: scipy's DOP853, stopped at every event."""
