"""Tests of files/formats/matrices/."""
