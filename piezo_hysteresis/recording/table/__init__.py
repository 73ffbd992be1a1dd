"""Columns of numbers and labels, their titles, units and time."""
