"""An FRF with its coherence and variance from the time signals of an impact test."""
