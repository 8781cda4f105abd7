"""Tests of the life of dampers."""
