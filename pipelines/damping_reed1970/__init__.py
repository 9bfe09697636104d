"""The report of 1970 recomputed: one folder a chapter, with its equations, its figures and its page."""
