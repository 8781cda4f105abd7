"""The exact engines, `line` for sliders and `plane` for all bodies: backends decides which runs, the rest is shared."""
