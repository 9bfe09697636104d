"""Resonant amplitude beyond the test."""
