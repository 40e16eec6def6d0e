"""A reflectance field handed to the museums' viewers: pictures with their `.lp`, polynomial textures, harmonics.

RTI files hold what a screen shows, so the field is exposed once for all lights and encoded as sRGB. Only lights on the
camera's side take part. The `.lp` is a count and a line a picture, `name x y z`, in the RTI frame: x right, y up, z
towards the camera.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import OutputNotWritten, warn
from relume.image.colour import encode_srgb
from relume.image.files import write
from relume.image.photograph import Photograph
from relume.lightstage.acquire.light_files import write_lp
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.rti.hemisphere_fit import before_camera
from relume.lightstage.rti.hsh import DEGREES, HemisphericalHarmonics, fit_hsh, write_hsh
from relume.lightstage.rti.ptm import PolynomialTexture, fit_lrgb, fit_rgb, write_ptm

_VALUES = 1 << 24
"""Numbers of a block of rows, all its lights together."""
_BRIGHT = 0.95
_TOLD = 1e-3
"""The share of values above white that is worth a warning; `RTIWritten.clipped` has it always."""


@dataclass(frozen=True)
class RTIForm:
    """What is written of a field for RTI viewers.

    pictures : "jpg", "png" or None for none
    ptm : "LRGB", "RGB" or None. LRGB unless given: half as large, and what most viewers open first
    hsh : degree of hemispherical harmonics, 1, 2 or 3, or None; 2 unless given, the most that all viewers read
    exposure : what the field is multiplied with before it is encoded. Unless given, 95 % of the lit pixels stay below
        white under every light
    """

    pictures: str | None = "jpg"
    ptm: str | None = "LRGB"
    hsh: int | None = 2
    exposure: float | None = None

    def __post_init__(self) -> None:
        if self.pictures not in ("jpg", "png", None) or self.ptm not in ("LRGB", "RGB", None):
            raise ValueError(f'{self}: expected pictures "jpg", "png" or None and ptm "LRGB", "RGB" or None')
        if self.hsh not in (*DEGREES, None):
            raise ValueError(f"hsh is {self.hsh}; expected a degree of 1, 2 or 3, or None")
        if not (self.pictures or self.ptm or self.hsh):
            raise ValueError("nothing to write; choose pictures, ptm or hsh")
        if self.exposure is not None and not 0 < self.exposure < np.inf:
            raise ValueError(f"exposure is {self.exposure}; expected a number above 0")


@dataclass(frozen=True)
class RTIWritten:
    """What was written.

    files : the .lp, .ptm and .rti there are; pictures lie beside the .lp
    lights, left_out : how many lights take part, and the names of those behind the subject
    exposure : what the field was multiplied with
    clipped : the share of values that were above white
    ptm_error, hsh_error : root of the mean square difference between the fit and the pictures, 1 the white; None
        where there is no such file
    """

    files: tuple[Path, ...]
    lights: int
    left_out: tuple[str, ...]
    exposure: float
    clipped: float
    ptm_error: float | None = None
    hsh_error: float | None = None


def export_rti(
    field: ReflectanceField, folder: str | os.PathLike[str], form: RTIForm = RTIForm(), name: str = "stage"
) -> RTIWritten:
    """Write a field for RTI viewers: FOLDER/NAME.ptm, NAME.rti, NAME.lp and its pictures.

    folder : made where it is missing
    form : which files, of what degree
    name : of the files, without spaces: an `.lp` parts its words by them
    Warns of lights that are left out and of values above white. Raises ValueError for too few lights before the camera
    and a field without light, OutputNotWritten.
    """
    if not name or name != Path(name).name or any(letter.isspace() for letter in name):
        raise ValueError(f'the files\' name is "{name}"; expected one word without a path')
    folder = Path(folder)
    chosen, directions = before_camera(field.lights, field.camera)
    left_out = tuple(field.lights.names[i] for i in np.setdiff1d(np.arange(len(field.lights)), chosen))
    exposure = _exposure(field, chosen) if form.exposure is None else form.exposure
    ptm, hsh, clipped, errors = _fits(field, chosen, directions, exposure, form)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{folder}: cannot be made: {error.strerror}; choose another place") from error
    files: list[Path] = []
    if ptm is not None:
        files.append(folder / f"{name}.ptm")
        write_ptm(files[-1], ptm)
    if hsh is not None:
        files.append(folder / f"{name}.rti")
        write_hsh(files[-1], hsh)
    if form.pictures:
        files.append(_write_pictures(field, chosen, directions, exposure, folder, name, form.pictures))
    if left_out:
        warn(
            f"{len(left_out)} of {len(field.lights)} lights stand behind the subject and are left out: RTI knows the "
            "hemisphere before the camera"
        )
    if clipped > _TOLD:
        warn(
            f"{clipped:.2%} of the values are above white at exposure {exposure:.3g} and are cut off; choose a "
            "lower exposure to keep them"
        )
    return RTIWritten(tuple(files), len(chosen), left_out, exposure, clipped, *errors)


def encoded(values: np.ndarray, exposure: float) -> np.ndarray:
    """Display code values in [0, 1] of a field's linear ones; what is above white is cut off."""
    return encode_srgb(np.clip(values * np.float32(exposure), 0, 1))


def _fits(
    field: ReflectanceField, chosen: np.ndarray, directions: np.ndarray, exposure: float, form: RTIForm
) -> tuple[PolynomialTexture | None, HemisphericalHarmonics | None, float, list[float | None]]:
    """The fits, from blocks of rows as a pixel's are its own; the share of values above white; and the fits' errors."""
    # Lights crowd where a stage's grid has its poles; each counts as much as the part of the sphere it speaks for.
    weights = field.lights.solid_angles[chosen]
    fit_ptm = fit_rgb if form.ptm == "RGB" else fit_lrgb
    textures: list[PolynomialTexture] = []
    harmonics: list[HemisphericalHarmonics] = []
    count = above = 0
    squares = [0.0, 0.0]
    for rows in _row_blocks(field):
        values = _lit(field, chosen, rows)
        above += int((values * np.float32(exposure) > 1).sum())
        count += values.size
        pictures = encoded(values, exposure)
        if form.ptm:
            textures.append(fit_ptm(pictures, directions, weights))
            squares[0] += _squares(textures[-1], pictures, directions)
        if form.hsh:
            harmonics.append(fit_hsh(pictures, directions, form.hsh, weights))
            squares[1] += _squares(harmonics[-1], pictures, directions)
    ptm = hsh = None
    if textures:
        colours = [texture.colour for texture in textures if texture.colour is not None]
        coefficients = np.concatenate([texture.coefficients for texture in textures])
        ptm = PolynomialTexture(coefficients, np.concatenate(colours) if colours else None)
    if harmonics:
        hsh = HemisphericalHarmonics(np.concatenate([part.coefficients for part in harmonics]))
    errors = [float(np.sqrt(total / count)) if fit else None for fit, total in zip((ptm, hsh), squares, strict=True)]
    return ptm, hsh, above / count, errors


def _squares(fit: PolynomialTexture | HemisphericalHarmonics, pictures: np.ndarray, directions: np.ndarray) -> float:
    shown = zip(pictures, directions, strict=True)
    return sum(
        float(np.square(np.clip(fit.lit_from(towards), 0, 1) - picture, dtype=np.float64).sum())
        for picture, towards in shown
    )


def _exposure(field: ReflectanceField, chosen: np.ndarray) -> float:
    """The factor that brings 95 % of the lit pixels below white, each under its brightest light."""
    brightest = np.concatenate([_lit(field, chosen, rows).max(axis=(0, 3)).ravel() for rows in _row_blocks(field)])
    lit = brightest[brightest > 0]
    if not lit.size:
        raise ValueError("the field is black under every light before the camera; there is nothing to show")
    return 1 / float(np.quantile(lit, _BRIGHT))


def _row_blocks(field: ReflectanceField) -> list[slice]:
    height, width = field.shape
    step = max(1, _VALUES // (len(field.lights) * width * 3))
    return [slice(begin, min(begin + step, height)) for begin in range(0, height, step)]


def _lit(field: ReflectanceField, chosen: np.ndarray, rows: slice) -> np.ndarray:
    return field.block(slice(0, len(field.lights)), rows)[chosen]


def _write_pictures(
    field: ReflectanceField,
    chosen: np.ndarray,
    directions: np.ndarray,
    exposure: float,
    folder: Path,
    name: str,
    suffix: str,
) -> Path:
    """The pictures, then the `.lp` that names them: where it is there, they all are."""
    digits = max(3, len(str(len(chosen))))
    names = []
    for number, light in enumerate(chosen, start=1):
        picture = field.block(slice(light, light + 1), slice(0, field.shape[0]))[0]
        codes = np.rint(encoded(picture, exposure) * 255).astype(np.uint8)
        file = f"{name}_{number:0{digits}d}.{suffix}"
        write(folder / file, Photograph(codes, file))
        names.append(file)
    write_lp(folder / f"{name}.lp", names, directions)
    return folder / f"{name}.lp"
