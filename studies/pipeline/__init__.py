"""One command from a case to a report: tables (the file), stages (the work), record (the work done), pipeline."""
