"""The structure of a model without broadband records: which effects it takes to predict other rates and amplitudes."""
