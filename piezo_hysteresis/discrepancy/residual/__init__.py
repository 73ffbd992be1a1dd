"""What a model leaves: residual, noise floor, and where the residual sits."""
