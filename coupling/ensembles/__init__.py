"""Ensembles: a scene whose numbers are ranges, run for samples of them; quantiles, and causes of the spread."""
