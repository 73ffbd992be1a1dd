"""What holds a stage safe beside its driver: the latch of a stop, and the keeper process with its link."""
