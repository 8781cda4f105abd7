"""Tests of coupling/engine/line/."""
