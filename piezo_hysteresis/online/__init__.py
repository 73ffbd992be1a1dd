"""A model that follows a stage block by block: prediction, residual, change of model in mid-stream."""
