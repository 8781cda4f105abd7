"""Numbers with their derivatives, which assembly, quantities and formulas take in the place of plain ones."""
