"""Tests of coupling/model_order/."""
