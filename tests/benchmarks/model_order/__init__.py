"""Tests of benchmarks/model_order/."""
