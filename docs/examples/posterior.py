"""Samples of the posterior density of a scene's numbers, by emcee: python posterior.py STUDY.toml."""

import sys

import emcee
import numpy as np

import vanedamp as vd

STEPS, DISCARDED = 400, 100

found = vd.identify(sys.argv[1])
density = vd.LogDensity(sys.argv[1], found.deviation)
walkers = 4 * len(found.paths)
spread = np.sqrt(np.diag(found.covariance)) * np.random.default_rng(1).standard_normal((walkers, len(found.paths)))
sampler = emcee.EnsembleSampler(walkers, len(found.paths), density)
sampler.run_mcmc(found.best + 0.3 * spread, STEPS)
samples = sampler.get_chain(discard=DISCARDED, flat=True)
for path, row, interval in zip(found.paths, samples.T, found.interval, strict=True):
    low, high = np.quantile(row, [0.025, 0.975])
    samples_text, profile_text = (f"{low:.4g} to {high:.4g}" for low, high in ((low, high), interval))
    print(f"{path}, 95 %: samples {samples_text}, profile likelihood {profile_text}")
