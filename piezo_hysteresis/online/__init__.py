"""A model that follows a stage block by block: prediction, residual, and a change of model while samples arrive."""
