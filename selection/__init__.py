"""Damping models from vibration tests: which law, how sure, how large at the design load."""

__version__ = "0.1.0"
