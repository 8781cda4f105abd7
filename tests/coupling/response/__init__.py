"""Tests of coupling/response/."""
