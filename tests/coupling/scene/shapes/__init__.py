"""Tests of coupling/scene/shapes/."""
