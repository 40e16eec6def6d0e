"""Histogram adjustment beside Radiance's own `pcond`, on maps of real places.

`pcond` is looked for on PATH and in the environment variable RELUME_PCOND; its sibling `pfilt` has to lie beside it.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from relume.image import files
from relume.image.colour import luminance
from relume.image.primaries import REC709, Primaries
from relume.virtual_camera.tone.histogram import adjustment as histogram
from relume.virtual_camera.tone.histogram import eye
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.histogram.curve import HumanContrast
from relume.virtual_camera.view import View

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
PCOND = os.environ.get("RELUME_PCOND") or shutil.which("pcond")

pytestmark = [
    pytest.mark.skipif(PCOND is None, reason="needs Radiance's pcond on PATH or in RELUME_PCOND"),
    pytest.mark.skipif(not DATA.is_dir(), reason="needs the maps of shared/data"),
]

# A picture without a PRIMARIES line has these; with one, `pcond` would convert and clip what it shows. The way there
# keeps luminances: X and Z alone are scaled from D65 to equal energy.
RADIANCE = Primaries((0.64, 0.33), (0.29, 0.60), (0.15, 0.06), (1 / 3, 1 / 3))
TO_RADIANCE = np.linalg.inv(RADIANCE.to_xyz()) @ (REC709.to_xyz() / REC709.to_xyz().sum(1, keepdims=True))
EFFICACY = 179  # lm/W, of Radiance's white


def shared_exponent(pixels):
    """(H, W, 4) uint8 as a Radiance picture has them."""
    most = pixels.max(-1)
    exponent = np.where(most > 1e-32, np.frexp(most)[1], -128)
    mantissa = np.floor(pixels * np.exp2(8.0 - exponent)[..., None])
    return np.concatenate([mantissa, exponent[..., None] + 128], -1).clip(0, 255).astype(np.uint8)


def linear(coded):
    """What Radiance takes them for: half a step above the mantissa."""
    values = (coded[..., :3] + 0.5) * np.exp2(coded[..., 3:].astype(float) - 136)
    return np.where(coded[..., 3:] > 0, values, 0)


def through_pcond(coded, view, options, folder):
    """The luminance of what `pcond` shows, 1 the screen's white."""
    height, width = coded.shape[:2]
    angles = (np.degrees(2 * np.arctan(side / 2 / view.focal_length)) for side in (width, height))
    header = [
        "#?RADIANCE",
        "VIEW= -vtv -vp 0 0 0 -vd 0 1 0 -vu 0 0 1 -vh {:.9g} -vv {:.9g}".format(*angles),
        f"EXPOSURE={EFFICACY / view.luminance_scale:.9g}",
        "FORMAT=32-bit_rle_rgbe",
        "",
        f"-Y {height} +X {width}\n",
    ]
    (folder / "in.hdr").write_bytes("\n".join(header).encode() + coded.tobytes())
    environment = {**os.environ, "PATH": os.pathsep.join([str(Path(PCOND or "").parent), os.environ["PATH"]])}
    words = [str(PCOND), *options, str(folder / "in.hdr"), str(folder / "out.hdr")]
    subprocess.run(words, env=environment, check=True, capture_output=True, timeout=60)
    # Read as it stands: without these primaries there is nothing to convert, and no warning.
    written = (folder / "out.hdr").read_bytes()
    said = b"PRIMARIES= " + REC709.text.encode() + b"\nFORMAT"
    (folder / "out.hdr").write_bytes(written.replace(b"FORMAT", said, 1))
    exposures = [float(value) for value in re.findall(rb"EXPOSURE=\s*(\S+)", written.split(b"\n\n", 1)[0])]
    shown = files.read_radiance(str(folder / "out.hdr")).radiance.astype(float) * np.prod(exposures)
    return shown @ RADIANCE.to_xyz()[1]


def median_difference(name, degrees, scale, operator, options, folder):
    pixels = np.maximum(files.read_radiance(str(DATA / name)).radiance, 0).astype(float)
    coded = shared_exponent(np.maximum(pixels @ TO_RADIANCE.T, 0))
    picture = np.maximum(linear(coded) @ np.linalg.inv(TO_RADIANCE).T, 0).astype(np.float32)
    view = View(picture.shape[1] / 2 / np.tan(np.radians(degrees) / 2), scale)
    theirs = through_pcond(coded, view, options, folder)
    ours = luminance(operator.display_values(picture, view, operator.adapt(picture, view)).astype(float))
    visible = theirs > 1e-3
    return float(np.median(np.abs(ours / np.maximum(theirs, 1e-3) - 1)[visible]))


MAPS = {
    "church": ("formats/memorial_exr/memorial.exr", 40, 1.0),
    "sun": ("hdri/spruit_sunrise/spruit_sunrise_1k.hdr", 90, 500.0),
    "cathedral": ("probes/latlong_small/grace.hdr", 90, 100.0),
}


@pytest.mark.parametrize("place", MAPS)
@pytest.mark.parametrize(
    ("operator", "options"),
    [
        (HistogramAdjustment(), []),
        (HistogramAdjustment(contrast=HumanContrast()), ["-s"]),
        (HistogramAdjustment(centre_weighted=True), ["-w"]),
    ],
    ids=["plain", "human contrast", "centre-weighted"],
)
def test_it_agrees_with_pcond(place, operator, options, tmp_path):
    # `pcond` draws its points at random; turned over, a picture differs from itself by up to 2.7 % in the median.
    assert median_difference(*MAPS[place], operator, options, tmp_path) <= 0.02


@pytest.mark.parametrize("place", ["church", "cathedral"])
def test_the_veil_agrees_with_pcond(place, tmp_path, monkeypatch):
    monkeypatch.setattr(eye, "SHARE", 0.08)
    monkeypatch.setattr(histogram, "SHARE", 0.08)
    assert median_difference(*MAPS[place], HistogramAdjustment(veil=True), ["-v"], tmp_path) <= 0.04
