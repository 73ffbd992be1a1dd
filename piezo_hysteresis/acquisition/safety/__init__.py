"""Safety beside the driver: the latch of a stop, and the keeper process with its link."""
