"""Tests of coupling/scene/elements/."""
