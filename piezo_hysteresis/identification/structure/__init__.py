"""The structure of a model without broadband records: the effects it needs to predict other rates and amplitudes."""
