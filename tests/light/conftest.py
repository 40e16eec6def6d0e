"""What the tests of reflected light share."""

from kept_lobes import lobes_are_kept

__all__ = ["lobes_are_kept"]
