"""The trained network: features, reducer, regressor, its training, its bundle, and warnings of unusual measurements."""
