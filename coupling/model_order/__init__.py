"""Choice of the number of modes and of the bodies, with error estimates."""
