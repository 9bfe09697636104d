"""The regression program: terms of columns, one fit with its statistics, which terms stay, what deviates."""
