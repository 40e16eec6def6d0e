"""Many tasks in this process, on the cores of one machine or on many machines; the names are those of the stub."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
