"""What the tests of whole chains share."""

from kept_lobes import lobes_are_kept

__all__ = ["lobes_are_kept"]
