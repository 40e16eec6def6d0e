"""Display transforms of OpenColorIO, such as ACES and AgX, as a tone operator.

The configuration's own view makes the picture, and what it encodes for its display is decoded again, by OpenColorIO
itself where it knows how, so that this package's display stage encodes it like every other operator's.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import decode_srgb
from relume.image.primaries import REC709
from relume.virtual_camera.protocols import Adaptation, Relative
from relume.virtual_camera.view import View

BUILT_IN = "ocio://default"
"""OpenColorIO's own configuration for computer graphics, of ACES: a name that it knows without a file."""
GREY = 0.18
"""Scene-linear middle grey, the anchor of ACES and AgX views."""
_LINEAR_REC709 = (
    "lin_rec709_srgb",
    "lin_rec709",
    "lin_rec709_scene",
    "lin_srgb",
    "Linear Rec.709 (sRGB)",
    "Linear Rec.709",
    "Linear BT.709",
    "Linear sRGB",
    "Utility - Linear - Rec.709",
    "Utility - Linear - sRGB",
    "sRGB - linear",
)
"""What configurations call it: ACES of all years, Blender, AgX and its offspring."""
_DISPLAY_ROLE = "cie_xyz_d65_interchange"
_BAND = 64


@dataclass(frozen=True)
class Ocio(Relative):
    """A view of an OpenColorIO configuration; needs the extra `ocio`.

    config : its file, or the name of a built-in one as "ocio://cg-config-v2.2.0_aces-v1.3_ocio-v2.4" (ACES 1.3). None
        takes what the environment variable OCIO names, as every program does that uses it, else `ocio://default`
    display, view : None for the configuration's default ones
    looks : applied to the scene before the view, in order
    grey : luminance, in the picture's unit, that the view is given as middle grey, 0.18; None for the picture's log
        mean, because maps are of any unit. 0.18 takes a picture as it is, as compositing programs do

    Values are linear for the display, 1 its white, in Rec. 709: a wider display's colours have negative channels, and
    an HDR view reaches above 1. Colours outside Rec. 709 that a view for it leaves are not clipped either.
    """

    config: str | None = None
    display: str | None = None
    view: str | None = None
    looks: tuple[str, ...] = ()
    grey: float | None = None

    def __post_init__(self) -> None:
        if self.grey is not None and not (np.isfinite(self.grey) and self.grey > 0):
            raise ValueError(f"grey is {self.grey}; expected a positive luminance, or None to measure it")
        if isinstance(self.looks, str):
            raise ValueError(f'looks is "{self.looks}"; expected a tuple of names, as ("{self.looks}",)')

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """The natural logarithm of what is shown as middle grey, in the picture's unit, as values (1,).

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        from relume.virtual_camera.tone.luminance_statistics import log_average

        grey = log_average(radiance) if self.grey is None else self.grey
        return Adaptation(np.array([np.log(grey)]))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear display values (H, W, 3) float32.

        radiance, adaptation : (H, W, 3) float32 in the picture's unit, and what `adapt` returned
        Raises ValueError where OpenColorIO is missing, its configuration cannot be read or does not know linear
        Rec. 709, for a display, view or look that it does not have, and for a view whose code values have no known
        decoding.
        """
        gain = np.float32(GREY / np.exp(adaptation.values[0]))
        processor, is_encoded = self._processor()
        height, width = radiance.shape[:2]
        # Beyond float32 everything is white in a view.
        with np.errstate(over="ignore"):
            shown = np.multiply(radiance, gain, order="C", dtype=np.float32)
        np.minimum(shown, np.finfo(np.float32).max, out=shown)

        def view_band(begin: int, end: int) -> None:
            band = shown[begin:end]
            processor.apply(_ocio().PackedImageDesc(band, width, end - begin, 3))
            if is_encoded:
                band[...] = decode_srgb(band)

        in_threads(view_band, height, chunk=_BAND)
        return shown

    def _processor(self) -> tuple[Any, bool]:
        """From linear Rec. 709 to linear Rec. 709 of the display, or to its sRGB code values: then True."""
        ocio = _ocio()
        name = self.config or os.environ.get("OCIO") or BUILT_IN
        try:
            config = ocio.Config.CreateFromFile(name)
        except (ocio.Exception, ocio.ExceptionMissingFile) as error:
            raise ValueError(
                f'OpenColorIO cannot use the configuration "{name}": {_in_one_line(error)}; '
                f"give a config.ocio file or a built-in name as {BUILT_IN}"
            ) from None
        display = _chosen("display", self.display, config.getDefaultDisplay(), config.getDisplays())
        view = _chosen("view", self.view, config.getDefaultView(display), config.getViews(display), f' of "{display}"')
        for look in self.looks:
            _chosen("look", look, "", config.getLookNames())
        source = next((space for space in _LINEAR_REC709 if config.getColorSpace(space)), None)
        if source is None:
            raise ValueError(
                f'the OpenColorIO configuration "{name}" names no linear Rec. 709 colour space; '
                f'give one the alias "{_LINEAR_REC709[0]}"'
            )
        steps = ocio.GroupTransform()
        if self.looks:
            steps.appendTransform(ocio.LookTransform(src=source, dst=source, looks=", ".join(self.looks)))
        steps.appendTransform(ocio.DisplayViewTransform(src=source, display=display, view=view))
        decoding = _decoding(config, display, view)
        for step in decoding or ():
            steps.appendTransform(step)
        try:
            return config.getProcessor(steps).getDefaultCPUProcessor(), decoding is None
        except (ocio.Exception, ocio.ExceptionMissingFile) as error:
            raise ValueError(f'OpenColorIO cannot make the view "{view}": {_in_one_line(error)}') from None


def _decoding(config: Any, display: str, view: str) -> list[Any] | None:
    """The steps from a view's code values to linear Rec. 709; None where they are sRGB and we decode them.

    A configuration of version 2 knows its displays as light, by way of CIE XYZ. In older ones a view is a colour space
    of the scene, whose inverse would undo the view as well: there the display's name decides.
    """
    ocio = _ocio()
    name = config.getDisplayViewColorSpaceName(display, view)
    space = config.getColorSpace(display if name == "<USE_DISPLAY_NAME>" else name)
    if space is None or space.isData():
        raise ValueError(f'the view "{view}" of "{display}" shows data, not a picture; choose another view')
    is_light = space.getReferenceSpaceType() == ocio.REFERENCE_SPACE_DISPLAY
    if is_light and config.hasRole(_DISPLAY_ROLE):
        matrix = np.eye(4)
        matrix[:3, :3] = np.linalg.inv(REC709.to_xyz())
        to_xyz = ocio.ColorSpaceTransform(src=space.getName(), dst=_DISPLAY_ROLE)
        return [to_xyz, ocio.MatrixTransform(matrix=matrix.ravel().tolist())]
    if "srgb" in display.lower():
        return None
    raise ValueError(
        f'this configuration does not say what the code values of its display "{display}" mean; choose an sRGB '
        f"display, or a configuration of version 2 with the role {_DISPLAY_ROLE}"
    )


def _chosen(kind: str, asked: str | None, default: str, known: Any, of: str = "") -> str:
    names = list(known)
    if asked is not None and asked not in names:
        listed = ", ".join(f'"{name}"' for name in names) or "none"
        raise ValueError(f'no {kind} "{asked}"{of} in the OpenColorIO configuration; it has {listed}')
    return asked or default


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _ocio() -> Any:
    try:
        import PyOpenColorIO
    except ImportError:
        raise ValueError(
            'display transforms need OpenColorIO, which is not installed: pip install "relume[ocio]"'
        ) from None
    return PyOpenColorIO
