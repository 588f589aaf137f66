"""Built-in substructures."""
