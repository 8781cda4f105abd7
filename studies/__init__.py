"""Pipelines and the command `vanedamp`: they compose modal, rom and coupling."""
