"""Tests of files/formats/."""
