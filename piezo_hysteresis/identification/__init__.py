"""Identification: excite, then delay, linear dynamics, hysteresis, and all of them jointly."""
