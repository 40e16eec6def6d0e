"""relume: photographs in, light out; light in, photographs out.

`__init__.pyi` is the one list of public names: each is loaded from the module named there when it is first used.
"""

import lazy_loader as _lazy

_attach, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("relume")
    return _attach(name)
