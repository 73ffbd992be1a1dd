"""Stages: the protocol (`stage`), the simulated plant (`simulated`), recorded ones (`replay`), real controllers."""
