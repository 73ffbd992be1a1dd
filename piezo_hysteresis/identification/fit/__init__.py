"""The joint least-squares fit in free run, and its covariance."""
