"""Tests of coupling/exponents/."""
