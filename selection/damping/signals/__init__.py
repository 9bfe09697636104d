"""Measured motion of a node to the motion of one mode (chapter III): displacement, modal, principal, planar."""
