"""Plotting functions: tables and arrays in, a matplotlib Figure out; style in one place."""
