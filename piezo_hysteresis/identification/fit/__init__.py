"""Least squares in free run: the joint fit and its covariance."""
