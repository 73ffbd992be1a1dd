"""Figures, tables and one page that a physicist can believe. The only room that draws.

``comparison`` holds an experiment and the models compared with it; every figure is a function in a file of its own that
takes a `ModelComparison` and returns a `Drawing`, or None where the experiment does not show what the figure would.
"""
