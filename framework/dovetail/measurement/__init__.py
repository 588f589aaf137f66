"""Measured FRFs and modal parameters: files, the accelerometer's mass, lines within a band, resampling, noise."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
