"""Tests of coupling/methods/scipy_ivp/."""
