"""Tests of coupling/system/."""
