"""Speed against named peers in the same run; medians of several runs, ratios are what counts."""
