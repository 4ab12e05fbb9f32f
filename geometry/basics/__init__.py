"""What is everything made of: arrays, boxes, constants, and the errors that a user reads?

The public names are listed in `__init__.pyi`; each is loaded when it is first used, errors without numpy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
