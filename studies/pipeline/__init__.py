"""One command from a case to a report: tables (the file), stages (what it does), record (what was done), pipeline."""
