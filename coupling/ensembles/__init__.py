"""Ensembles: a scene whose numbers are ranges, run for samples of them; quantiles, and what the spread is due to."""
