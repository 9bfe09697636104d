"""Data of known truth, generated without the library's solvers, and the scoring of answers to them."""
