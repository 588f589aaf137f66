"""Built-in joints."""
