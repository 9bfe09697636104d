"""Candidates, fits and the ranking of damping laws."""
