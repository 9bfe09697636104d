"""Posteriors of damping laws: observations, laws, likelihood, evidence, chains, diagnostics."""

#: Seed of everything sampled where none is stated, that of the command line.
SEED = 1970
