"""Tests of meshes/."""
