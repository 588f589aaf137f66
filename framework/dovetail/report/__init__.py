"""The report of an identification and its figures."""
