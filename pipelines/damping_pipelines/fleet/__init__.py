"""``damping fleet``: many records ranked, extrapolated and diagnosed on Dask, streamed to a Parquet data set."""
