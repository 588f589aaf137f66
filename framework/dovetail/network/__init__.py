"""The trained network: features, reducer, regressor, its training, its bundle, and what is unlike its training."""
