"""Choice of the number of modes, with an error estimate."""
