"""Tests of rom/."""
