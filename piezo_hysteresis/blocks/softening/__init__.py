"""Numerical building blocks of softening: linear dynamics with a nonlinear stiffness in one mode or in all."""
