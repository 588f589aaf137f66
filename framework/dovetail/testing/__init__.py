"""The conformance kit, which checks your component in a test, in Python or with ``dovetail check-plugin``.

The public names are listed in ``__init__.pyi`` in this folder. Each is loaded when it is first used, since a fresh
process that evaluates a component needs few of these modules.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
