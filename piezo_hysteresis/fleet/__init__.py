"""Many recordings on Dask: identify, validate or diagnose each, one row of a Parquet table for each."""
