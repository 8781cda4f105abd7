"""Numbers of a scene from measurements, with what the measurements tell of each."""
