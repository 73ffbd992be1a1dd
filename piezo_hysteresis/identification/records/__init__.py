"""What each record of an experiment is good for."""
