"""The model node: publishes prediction and residual of every sample."""
