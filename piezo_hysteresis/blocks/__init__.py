"""Numerical building blocks of the effects: filters, relaxations, delays and the Bouc-Wen kernels."""
