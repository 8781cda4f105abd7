"""Claims of a study and what became of them: a page for the report only."""
