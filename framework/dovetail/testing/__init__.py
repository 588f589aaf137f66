"""The conformance kit: run it over a component of your own, in a test, in Python or by ``dovetail check-plugin``.

The public names stand in ``__init__.pyi`` beside this file. Each is loaded when it is first used: a fresh process, in
which a component answers, needs few of these modules.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
