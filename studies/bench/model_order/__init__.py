"""Model order: the ladder, and trials of the automatic choice."""
