"""Speed of the exact engine."""
