"""The search for the missing effect: candidates, joint refits, cross-validation and acceptance tests."""
