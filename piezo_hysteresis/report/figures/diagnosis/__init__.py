"""Figures of a diagnosis: the gap before and after, and the probabilities over time."""
