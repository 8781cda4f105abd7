"""Meshes of other programs: a reader for each format gives a `labelled_mesh`; `registry` chooses it."""
