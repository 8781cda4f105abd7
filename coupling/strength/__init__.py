"""Strength: stress at hot spots, fatigue data of materials, utilisation, life, wear, strength of contacts."""
