"""Changed parameters of a given model: the stage is the same, but later, softer, or with a filter in its chain."""
