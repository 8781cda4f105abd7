"""Tests of studies/commands/."""
