"""The commands that the package adds to the command line."""
