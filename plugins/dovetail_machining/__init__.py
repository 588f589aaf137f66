"""Machine tools: the receptance of a spindle's flange from impact tests, and its command.

The public names are listed in ``__init__.pyi`` in this folder. Each is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
