"""Tests: closed forms, rates, published cases and independent solutions."""
