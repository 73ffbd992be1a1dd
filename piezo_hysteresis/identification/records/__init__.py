"""Which records of an experiment serve which purpose."""
