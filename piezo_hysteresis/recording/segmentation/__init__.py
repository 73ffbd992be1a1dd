"""Cuts a long record into phases, names them, and averages long records while they are read."""
