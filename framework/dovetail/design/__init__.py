"""Where to measure: the gain of a measurement at other points, before it is made."""
