"""The harmonics of a lobe, found once for all tests: light under hundreds of lights asks for those of a dozen."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from relume.light.reflection import convolution, glossy


def kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with its answers kept, read-only, where its arguments may be compared."""

    @lru_cache(maxsize=1024)
    def answer(*arguments: Any) -> Any:
        found = function(*arguments)
        for each in found if isinstance(found, tuple) else (found,):
            if isinstance(each, np.ndarray):
                each.flags.writeable = False
        return found

    def asked(*arguments: Any) -> Any:
        return answer(*arguments) if all(isinstance(each, Hashable) for each in arguments) else function(*arguments)

    return asked


zonal_coefficients, kernels = kept(convolution.zonal_coefficients), kept(glossy._kernels)


@pytest.fixture(scope="module", autouse=True)
def lobes_are_kept() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(convolution, "zonal_coefficients", lambda *given: np.array(zonal_coefficients(*given)))
        patch.setattr(glossy, "_kernels", kernels)
        yield
