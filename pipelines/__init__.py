"""Settings, files, progress and the command line; everything that computes is in ``selection``."""
