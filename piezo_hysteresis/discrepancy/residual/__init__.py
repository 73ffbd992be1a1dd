"""The residual of a model: its noise floor, where it is large, and what sampling adds to it."""
