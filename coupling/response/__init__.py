"""From records of a run to its response, for every method."""
