"""A camera's profile as a virtual camera uses it: its response, vignetting and scale, where they hold."""

from __future__ import annotations

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.capture.response.camera_profile import CameraProfile
from relume.capture.scale.absolute import Scale
from relume.image.photograph import Exposure
from relume.image.response import Response


def profiled_response(profile: CameraProfile) -> Response:
    """The response with the profile's balance in it, as merging has it; raises ValueError for a profile of raws."""
    if profile.response is None:
        raise ValueError(
            f"the profile of {profile.camera or 'a camera'} is of raws, and holds no response; give another"
        )
    if profile.balance == (1, 1, 1):
        return profile.response
    # The balance is a factor on radiance that was measured, so its inverse on what is to be exposed.
    curves = profile.response.log_exposure + np.log(profile.balance)[:, None]
    return Response(curves, profile.response.noise)


def profiled_vignetting(profile: CameraProfile) -> Vignetting | None:
    """The fall-off; None where it was not measured."""
    return None if profile.vignetting is None else Vignetting.from_dict(profile.vignetting)


def profiled_scale(profile: CameraProfile, exposure: Exposure | None) -> Scale | None:
    """cd/m² per unit of that camera's radiance, where it holds for an exposure; None where it does not.

    Relative radiance takes an unknown f-number as 1 and an unknown ISO as 100, so a scale holds for exposures that have
    the same settings as those it was measured with.
    """
    if profile.scale is None or exposure is None:
        return None
    if profile.scale_exposure not in (None, (exposure.f_number is not None, exposure.iso is not None)):
        return None
    return Scale.grey(profile.scale, profile.scale_deviation or 0.0, "the camera's profile")
