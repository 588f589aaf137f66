"""HTML reports of the evaluations, their tables and their figures."""
