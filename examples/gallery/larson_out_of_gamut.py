"""Larson 1998, Fig. 4 and 5: what eight bits of PhotoYCC lose of a picture, and what LogLuv keeps.

python examples/gallery/larson_out_of_gamut.py OUT.png
python examples/gallery/larson_out_of_gamut.py OUT.png PICTURE.exr

(a) the picture in PhotoYCC ("up to 200 % reflectance"), shown linearly. (b) Where that coding is wrong: red where it is
too bright or too dim, so that luminance is off by more than 5 %; green where the colour is, by more than 0.005 of u′v′.
The sun, a few pixels of the light map, is yellow in it: each of the three bytes is cut at a bound of its own.
(c) PhotoYCC and (d) 32-bit LogLuv, both by the same histogram adjustment (Larson, Rushmeier & Piatko 1997). Without a
picture a street of our own is rendered, with the sun in it, deep shade and strong paints; a prism's spectrum lies on
its wall, whose colours no screen has.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import relume as rl
from relume.image.colour import luminance
from relume.image.primaries import REC709
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.virtual_camera.lens.glare.wavelengths import colour_matching

WIDTH, HEIGHT, SAMPLES = 420, 280, 256
DIM, COLOUR = 0.05, 0.005
"""Errors of luminance, as a share, and of u′v′ that count."""
# PhotoYCC: Luma, Chroma1 = B′ − Luma, Chroma2 = R′ − Luma as bytes.
SCALES, OFFSETS = np.array([255 / 1.402, 111.40, 135.64]), np.array([0.0, 156.0, 137.0])
WEIGHTS = np.array([0.299, 0.587, 0.114])


def street() -> np.ndarray:
    """A picture (HEIGHT, WIDTH, 3) against the sun: a wall in its shade, and balls of paint."""
    ways = pixel_directions(LatLong(), 256)
    up = np.clip(ways[..., 1:2], 0, 1)
    sun = np.array([0.28, 0.34, -0.9])
    cosine = np.clip(ways @ (sun / np.linalg.norm(sun)), -1, 1)[..., None]
    sky = np.array([0.35, 0.6, 1.5]) * (1 - 0.5 * up) + 12 * np.array([1.0, 0.9, 0.75]) * np.exp(-(1 - cosine) / 0.01)
    sky = np.where(cosine > np.cos(np.radians(1.2)), 9000 * np.array([1.0, 0.92, 0.8]), sky)
    light = rl.EnvironmentMap(np.where(ways[..., 1:2] < -0.02, 0.15, sky).astype(np.float32))

    def paint(red: float, green: float, blue: float) -> rl.Material:
        return rl.Material((red, green, blue), roughness=0.4)

    house = rl.Mesh(
        np.array([[-6, 0, -5], [-1.2, 0, -6], [-1.2, 3.5, -6], [-6, 3.5, -5]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        paint(0.06, 0.015, 0.008),
    )
    balls = (
        rl.Sphere((-1.9, 0.5, -2.6), 0.5, paint(0.9, 0.01, 0.01)),
        rl.Sphere((-0.7, 0.5, -2.2), 0.5, paint(0.01, 0.6, 0.03)),
        rl.Sphere((0.5, 0.5, -2.6), 0.5, paint(0.01, 0.03, 0.9)),
        rl.Sphere((1.7, 0.5, -2.2), 0.5, paint(0.9, 0.7, 0.005)),
        rl.Sphere((2.7, 0.35, -1.2), 0.35, rl.Material((0.0, 0.0, 0.0), emission=(0.1, 0.2, 9.0))),
    )
    scene = rl.Scene(light, local=(rl.Plane(rl.Diffuse((0.22, 0.21, 0.2))),), objects=(house, *balls))
    camera = rl.Camera.looking_at(
        np.array([0.0, 1.3, 3.5]), np.array([0.0, 1.25, -2.0]), width=WIDTH, height=HEIGHT, focal_length=0.85 * WIDTH
    )
    picture = rl.render(scene, camera, rl.Mitsuba(SAMPLES), seed=2).radiance
    return picture + spectrum(np.s_[int(0.3 * HEIGHT) : int(0.48 * HEIGHT), int(0.06 * WIDTH) : int(0.34 * WIDTH)])


def spectrum(place: tuple[slice, slice]) -> np.ndarray:
    """Daylight that a prism spreads over a part of the picture, in Rec. 709: single wavelengths, partly below 0."""
    picture = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    band = picture[place]
    colours = colour_matching(np.linspace(400, 680, band.shape[1])) @ np.linalg.inv(REC709.to_xyz()).T
    picture[place] = 0.5 * colours
    return picture


def photo_ycc(linear: np.ndarray) -> np.ndarray:
    """Linear Rec. 709 (H, W, 3), 1 a white of 100 %, as it comes back from bytes of PhotoYCC."""
    size = np.abs(linear)
    coded = np.sign(linear) * np.where(size < 0.018, 4.5 * size, 1.099 * size**0.45 - 0.099)
    luma = coded @ WEIGHTS
    parts = np.stack([luma, coded[..., 2] - luma, coded[..., 0] - luma], axis=-1)
    parts = (np.clip(np.rint(parts * SCALES + OFFSETS), 0, 255) - OFFSETS) / SCALES
    blue, red = parts[..., 1] + parts[..., 0], parts[..., 2] + parts[..., 0]
    green = (parts[..., 0] - WEIGHTS[0] * red - WEIGHTS[2] * blue) / WEIGHTS[1]
    decoded = np.stack([red, green, blue], axis=-1)
    size = np.abs(decoded)
    return np.sign(decoded) * np.where(size < 0.081, size / 4.5, ((size + 0.099) / 1.099) ** (1 / 0.45))


def log_luv(linear: np.ndarray) -> np.ndarray:
    """The same as it comes back from a 32-bit LogLuv TIFF."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.tif")
        rl.write(path, rl.RadianceMap(linear.astype(np.float32)), rl.files.LogLuv(32))
        return rl.read_radiance(path).radiance


def faults(original: np.ndarray, coded: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where luminance is wrong, and where only the colour is, (H, W) bool each."""
    bright = luminance(original)
    wrong = np.abs(luminance(coded) - bright) > DIM * bright
    to_xyz = REC709.to_xyz()

    def chromaticity(picture: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(picture @ to_xyz.T, -1, 0)
        total = np.maximum(x + 15 * y + 3 * z, 1e-12)
        return np.stack([4 * x, 9 * y], axis=-1) / total[..., None]

    apart = np.linalg.norm(chromaticity(coded) - chromaticity(original), axis=-1)
    return wrong, ~wrong & (apart > COLOUR)


def figure(picture: np.ndarray) -> Figure:
    """The four panels."""
    # A white surface in this light: the brightest of all but the sky and the sun, as a photographer exposes.
    white = float(np.percentile(luminance(picture), 60)) / 0.5
    original = picture.astype(np.float64) / white
    ycc, luv = photo_ycc(original), log_luv(original)
    dim, tinted = faults(original, ycc)
    luv_dim, luv_tinted = faults(original, luv)
    shown = rl.develop(ycc.astype(np.float32), rl.Film(0.7)).pixels
    marked = np.repeat(shown.mean(axis=-1, keepdims=True) * 0.5, 3, axis=-1).astype(np.uint8)
    marked[dim], marked[tinted] = (220, 40, 30), (30, 180, 60)
    operator = rl.tone.HistogramAdjustment()
    panels = (
        ("(a) PhotoYCC, shown linearly", shown),
        (f"(b) {dim.mean():.1%} too bright or too dim (red), {tinted.mean():.1%} off in colour (green)", marked),
        ("(c) PhotoYCC, histogram adjustment", rl.develop(np.maximum(ycc, 0).astype(np.float32), operator).pixels),
        (
            f"(d) LogLuv, histogram adjustment; {luv_dim.mean():.1%} and {luv_tinted.mean():.1%} off",
            rl.develop(np.maximum(luv, 0).astype(np.float32), operator).pixels,
        ),
    )
    page = Figure(figsize=(10, 7.2), dpi=100, layout="constrained")
    for axis, (title, pixels) in zip(page.subplots(2, 2).flat, panels, strict=True):
        axis.imshow(pixels, interpolation="nearest")
        axis.set_title(title, fontsize=9)
        axis.set_axis_off()
    return page


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        raise SystemExit(__doc__)
    figure(rl.read_radiance(sys.argv[2]).radiance if len(sys.argv) == 3 else street()).savefig(sys.argv[1])
