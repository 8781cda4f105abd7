"""Long commands, each a job: an input that is checked, work that is shown and resumes after a kill, and its results."""
