"""Tests of coupling/scene/."""
