"""Built-in regressors."""
