"""Discovery of components and commands by hooks, from installed packages and single files.

The public names are listed in ``__init__.pyi`` in this folder. Each is loaded when it is first used, so that a plugin's
``import dovetail`` and ``@dovetail.hookimpl`` stay light.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
