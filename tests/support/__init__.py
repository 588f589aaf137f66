"""What several test modules share: assemblies, measurements, files, and independent formulas."""
