"""Tests of modal/."""
