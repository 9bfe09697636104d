"""Data whose truth is known, made without the library's solvers, and what scores the answers to it."""
