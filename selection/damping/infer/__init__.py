"""Posteriors of damping laws: observations, laws, likelihood, evidence, chains, diagnostics."""
