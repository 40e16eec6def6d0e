"""Scene + camera → radiance: `relume.renderers` holds the renderers that one reads, watches and compares."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
