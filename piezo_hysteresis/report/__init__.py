"""Figures, tables and the HTML page. No other room draws.

``figures.comparison`` holds an experiment and the models compared with it. Every figure is a function in its own file.
It takes a `ModelComparison` and returns a `Drawing`, or None if the experiment has no data for the figure.
"""
