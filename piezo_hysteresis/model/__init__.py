"""`Model`, a chain of effects with its scales, and its file."""
