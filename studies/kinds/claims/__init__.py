"""Claims of a study and their verdicts: a page for the report only."""
