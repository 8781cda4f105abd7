"""What the user says: scenes as validated records."""
