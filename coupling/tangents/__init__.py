"""Numbers with their derivatives, which assembly, quantities and formulas take instead of plain ones."""
