"""Tests of coupling/engine/plane/."""
