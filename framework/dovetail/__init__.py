"""Dovetail identifies the parameters of a mechanical joint from one measured frequency response function.

The public names are listed in ``__init__.pyi`` next to this file. Each is loaded when it is first used, so that
``import dovetail`` stays light. Longer steps are logged under the name "dovetail".
"""

import logging

import lazy_loader

from dovetail.version import __version__ as __version__

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

logging.getLogger(__name__).addHandler(logging.NullHandler())
