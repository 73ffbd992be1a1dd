"""What may be wrong with the data of an experiment."""
