"""Diagnosis of the gap between a simulation and a test: how large, where, which effect, how far, what to test next."""
