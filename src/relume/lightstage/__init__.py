"""Light stages (OLAT, one light at a time): import, relight, new views, surfaces, mattes, LED drive, RTI files."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
