"""What every format of radiance must do alike: keep what it can, be read by others, leave nothing half written."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from other_programs import by_opencv, by_openimageio
from relume.image import files
from relume.image.files.encodings import (
    PFM,
    Encoding,
    FloatTIFF,
    LogLuv,
    OpenEXR,
    RadianceHDR,
    RawFloat,
)
from relume.image.radiance import RadianceMap


@dataclass(frozen=True)
class Format:
    """One encoding: the name of a file, its error as a share of a pixel's largest channel, and what it keeps."""

    name: str
    encoding: Encoding
    error: float
    kind: str
    unit: bool = True
    attributes: bool = True


FORMATS = {
    "exr": Format("a.exr", OpenEXR(), 0.0, "EXR"),
    "exr half": Format("a.exr", OpenEXR(half=True), 2**-11, "EXR"),
    "rgbe": Format("a.hdr", RadianceHDR(), 1 / 256, "HDR"),
    "rgbe flat": Format("a.pic", RadianceHDR(compressed=False), 1 / 256, "HDR"),
    "xyze": Format("a.hdr", RadianceHDR(xyz=True), 0.02, "HDR"),
    "tiff": Format("a.tif", FloatTIFF(), 0.0, "float TIFF"),
    "tiff plain": Format("a.tiff", FloatTIFF(compressed=False), 0.0, "float TIFF"),
    "logluv32": Format("a.tif", LogLuv(32), 0.04, "LogLuv TIFF"),
    "logluv24": Format("a.tif", LogLuv(24), 0.06, "LogLuv TIFF"),
    "pfm": Format("a.pfm", PFM(), 0.0, "PFM", unit=False, attributes=False),
    "pfm big": Format("a.pfm", PFM(big_endian=True), 0.0, "PFM", unit=False, attributes=False),
    "float": Format("a.float", RawFloat(), 0.0, "raw float", unit=False, attributes=False),
    "float gz": Format("a.float.gz", RawFloat(big_endian=True), 0.0, "raw float", unit=False, attributes=False),
}
EVERY = pytest.mark.parametrize("form", FORMATS.values(), ids=FORMATS.keys())


@pytest.fixture
def picture() -> RadianceMap:
    """32 × 32 pixels of smooth colours over eight stops, row 0 the brightest, the left reddish."""
    y, x = np.mgrid[0:32, 0:32] / 31
    colours = np.stack([1 - 0.4 * x, np.full_like(x, 0.8), 0.6 + 0.4 * x], axis=-1)
    radiance = (4 * 2.0 ** (-8 * y[..., None]) * colours).astype(np.float32)
    attributes = {"mapping": "latlong", "camera": "Böhm & Söhne 7", "iso": "200", "exposure_time": "0.02"}
    return RadianceMap(radiance, unit="cd/m²", attributes=attributes)


def written(path: Path, image: RadianceMap, encoding: Encoding) -> list[str]:
    """Write it; the warnings."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        files.write(path, image, encoding)
    return [str(one.message) for one in said]


@EVERY
def test_a_picture_comes_back_upright_within_the_formats_error(
    form: Format, picture: RadianceMap, tmp_path: Path
) -> None:
    path = tmp_path / form.name
    said = written(path, picture, form.encoding)
    assert files.kind_of(path) == form.kind and files.subtype(path)
    back = files.read_radiance(path)
    largest = picture.radiance.max(-1, keepdims=True)
    assert np.abs(back.radiance - picture.radiance).max() <= form.error * largest.max()
    assert (np.abs(back.radiance - picture.radiance) / largest).max() <= form.error
    assert back.unit == (picture.unit if form.unit else "relative")
    if form.attributes:
        assert {key: back.attributes.get(key) for key in picture.attributes} == picture.attributes
    else:
        assert back.attributes == {}
    lost = [line for line in said if "does not keep" in line]
    assert len(lost) == (0 if form.attributes else 1)
    assert not lost or all(word in lost[0] for word in ("cd/m²", "mapping", "camera", "iso", ".exr"))


@EVERY
def test_planes_that_a_format_cannot_hold_are_reported(form: Format, picture: RadianceMap, tmp_path: Path) -> None:
    marks = np.zeros((32, 32), np.uint8)
    marks[3, 4] = 1
    marked = RadianceMap(picture.radiance, picture.radiance**2, marks)
    said = written(tmp_path / form.name, marked, form.encoding)
    said = [line for line in said if "variance" in line and "clipped" in line]
    assert len(said) == (0 if form.kind == "EXR" else 1)


@pytest.mark.parametrize("name", ["a.hdr", "a.pfm", "a.float"])
def test_a_map_without_pixels_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"the map (is|has) 0 x 3 pixels"):
        files.write(tmp_path / name, RadianceMap(np.empty((3, 0, 3), np.float32)))


@EVERY
@pytest.mark.parametrize("fault", [np.nan, np.inf, -1.0])
def test_what_no_light_is_is_kept_or_refused_and_never_changed(
    form: Format, fault: float, picture: RadianceMap, tmp_path: Path
) -> None:
    odd = picture.radiance.copy()
    odd[5, 7, 1] = fault
    if (fault == -1.0 and form.kind == "LogLuv TIFF") or form.encoding == RadianceHDR(xyz=True):
        odd[5, 7] = fault  # a negative channel alone may be a colour
    path = tmp_path / form.name
    try:
        said = written(path, RadianceMap(odd), form.encoding)
    except ValueError as error:
        assert "1 of" in str(error) or "1 pixel" in str(error) or " 1 " in str(error), error
        assert list(tmp_path.iterdir()) == []
        return
    np.testing.assert_allclose(files.read_radiance(path).radiance[5, 7], odd[5, 7], rtol=form.error, err_msg=str(said))


_FULL = """
import resource, signal, sys, warnings
import numpy as np
warnings.simplefilter("ignore")
sys.path[:0] = [{tests!r}, {tests!r} + "/support", {tests!r} + "/image"]
from pathlib import Path
from relume.errors import OutputNotWritten
from relume.image import files
from relume.image.radiance import RadianceMap
from test_every_format import FORMATS
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
noise = np.random.default_rng(1).random((96, 96, 3), np.float32) + 0.5
for name, form in FORMATS.items():
    folder = Path({folder!r}) / name
    folder.mkdir()
    # Once without the limit: kernels are compiled and kept on disk, too.
    files.write(folder / form.name, RadianceMap(noise), form.encoding)
    (folder / form.name).write_bytes(b"old")
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
    try:
        files.write(folder / form.name, RadianceMap(noise), form.encoding)
        print(name, "was written")
    except OutputNotWritten as error:
        if str(folder / form.name) not in str(error) or "\\n" in str(error):
            print(name, "says", error)
    except BaseException as error:
        print(name, "raises", repr(error))
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    left = [path.name for path in folder.iterdir()]
    if left != [form.name] or (folder / form.name).read_bytes() != b"old":
        print(name, "leaves", left)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files by RLIMIT_FSIZE")
def test_a_disk_that_fills_up_leaves_the_old_file_and_says_so(tmp_path: Path) -> None:
    code = _FULL.format(tests=str(Path(__file__).parents[1]), folder=str(tmp_path))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)


def _openexr(path: Path) -> np.ndarray:
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        return file.channels()["RGB"].pixels


def _numpy(path: Path) -> np.ndarray:
    import gzip

    data = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    return np.frombuffer(data, ">f4" if path.suffix == ".gz" else "<f4").reshape(32, 32, 3)


FOREIGN: dict[str, tuple[Callable[[Path], np.ndarray], ...]] = {
    "exr": (by_openimageio, _openexr),
    "exr half": (by_openimageio, _openexr),
    "rgbe": (by_opencv, by_openimageio),
    "rgbe flat": (by_opencv, by_openimageio),
    "tiff": (by_opencv, by_openimageio),
    "tiff plain": (by_opencv, by_openimageio),
    "logluv32": (by_opencv,),  # the second, libtiff, is in test_logluv_tiff
    "logluv24": (by_opencv,),
    "pfm big": (by_opencv,),
    "pfm": (by_opencv,),  # OpenImageIO does not turn rows over; Pillow reads grey ones alone: test_pfm
    "float": (_numpy,),
    "float gz": (_numpy,),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_other_programs_read_the_same_values(name: str, picture: RadianceMap, tmp_path: Path) -> None:
    form = FORMATS[name]
    path = tmp_path / form.name
    # OpenCV leaves STONITS, the scale of calibrated LogLuv, to its caller.
    written(path, replace(picture, unit="relative"), form.encoding)
    largest = picture.radiance.max(-1, keepdims=True)
    for reader in FOREIGN[name]:
        seen = reader(path)[..., :3]
        assert seen.shape == picture.radiance.shape, reader
        assert (np.abs(seen - picture.radiance) / largest).max() <= form.error * 1.001, reader
