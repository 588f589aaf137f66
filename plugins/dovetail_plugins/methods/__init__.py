"""Methods of identification."""
