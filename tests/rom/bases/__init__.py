"""Tests of rom/bases/."""
