"""From the time signals of an impact test to an FRF, its coherence and its variance."""
