"""The compensation node: it drives the stage where it should go, through the inverse of the model."""
