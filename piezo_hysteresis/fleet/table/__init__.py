"""The results of a fleet: a partitioned table in Parquet with one row per recording and task."""
