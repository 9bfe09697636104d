"""Every printed result of the report that can be recomputed: one module a chapter, formulas named after equations."""
