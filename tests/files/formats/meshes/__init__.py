"""Tests of files/formats/meshes/."""
