"""Strength: stress at the hot spots of reduced models."""
