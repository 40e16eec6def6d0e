"""Half on request: where halves hold a picture, and what is said where they do not."""

import warnings

import numpy as np
import OpenEXR
import pytest

from other_programs import by_openimageio
from relume.image import bands
from relume.image.files import encodings, read_radiance, write
from relume.image.radiance import RadianceMap

HALF = encodings.OpenEXR(half=True)


def kinds(path):
    return [next(iter(part.channels.values())).pixels.dtype.name for part in OpenEXR.File(str(path)).parts]


def test_halves_err_by_at_most_their_step_and_take_half_the_room(tmp_path):
    """Q4: 2⁻¹¹ of the value; a picture of all brightness that halves hold in full."""
    rng = np.random.default_rng(1)
    pixels = np.exp2(rng.uniform(-14, 15.99, (200, 100, 3))).astype(np.float32)
    pixels[0, 0] = 65504, 2**-14, -2048.5
    write(tmp_path / "a.exr", RadianceMap(pixels), HALF)
    write(tmp_path / "b.exr", RadianceMap(pixels))
    assert (kinds(tmp_path / "a.exr"), kinds(tmp_path / "b.exr")) == (["float16"], ["float32"])
    found = read_radiance(tmp_path / "a.exr").radiance
    errors = np.abs(found.astype(float) / pixels - 1)
    assert 2**-11.1 < errors.max() <= 2**-11
    assert abs(np.mean(found.astype(float) / pixels - 1)) < 2e-6  # rounded to nearest: no bias
    assert found[0, 0].tolist() == [65504, 2**-14, -2048]  # ties to even
    assert (tmp_path / "a.exr").stat().st_size < 0.6 * (tmp_path / "b.exr").stat().st_size


def test_another_program_reads_the_same_halves(tmp_path):
    pixels = np.random.default_rng(2).gamma(0.5, 100, (30, 40, 3)).astype(np.float32) + np.float32(0.001)
    for encoding, bound in ((HALF, 2**-11), (encodings.OpenEXR(), 0)):
        write(tmp_path / "a.exr", RadianceMap(pixels), encoding)
        found = by_openimageio(tmp_path / "a.exr")
        np.testing.assert_allclose(found, pixels, rtol=bound, atol=0)
        np.testing.assert_array_equal(found, read_radiance(tmp_path / "a.exr").radiance)


def test_a_sun_beyond_half_makes_it_float_and_never_infinite(tmp_path):
    pixels = np.ones((4, 4, 3), np.float32)
    pixels[1, 2, :2] = 65504.1, 1e6
    with pytest.warns(UserWarning, match=r"a\.exr: radiance is stored as float, not half: 2 values are beyond 65504,"):
        write(tmp_path / "a.exr", RadianceMap(pixels), HALF)
    np.testing.assert_array_equal(read_radiance(tmp_path / "a.exr").radiance, pixels)


def test_what_is_infinite_or_no_number_stays_so_in_half(tmp_path):
    pixels = np.full((2, 2, 3), 0.5, np.float32)
    pixels[0, 0] = np.inf, -np.inf, np.nan
    write(tmp_path / "a.exr", RadianceMap(pixels), HALF)
    assert kinds(tmp_path / "a.exr") == ["float16"]
    np.testing.assert_array_equal(read_radiance(tmp_path / "a.exr").radiance, pixels)


@pytest.mark.parametrize(("dim", "kind"), [(0, "float16"), (1, "float16"), (2, "float32")])
def test_a_picture_so_dim_that_halves_lose_it_is_float(tmp_path, dim, kind):
    """Of 150 values, one may be lost, 0.7 %, and two may not, 1.3 %; black and exact denormals are not lost."""
    pixels = np.zeros((10, 10, 3), np.float32)
    pixels.reshape(-1)[:148] = 1
    pixels.reshape(-1)[148:150] = 2.0**-20
    pixels.reshape(-1)[:dim] = 1.2345e-6
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        write(tmp_path / "a.exr", RadianceMap(pixels), HALF)
    assert kinds(tmp_path / "a.exr") == [kind]
    lost = f"{dim} of its 150 values other than 0 are so small that halves lose more than 1/2048 of them"
    texts = [
        f"stored as half, though {lost}; float keeps them (leave out --half, in Python half=True)",
        f"stored as float, not half: {lost}",
    ]
    assert [str(warning.message) for warning in said] == [
        f"{tmp_path}/a.exr: radiance is {t}" for t in texts[dim - 1 : dim] if dim
    ]


def test_values_that_half_makes_0_are_counted(tmp_path):
    pixels = np.ones((20, 20, 3), np.float32)
    pixels[5, 5] = 1e-9, 2e-8, 1e-6
    with pytest.warns(UserWarning, match="half, though 3 of its 1200 values .* 1/2048 of them, and 2 become 0; float"):
        write(tmp_path / "a.exr", RadianceMap(pixels), HALF)
    found = read_radiance(tmp_path / "a.exr").radiance
    assert (np.count_nonzero(found == 0), kinds(tmp_path / "a.exr")) == (2, ["float16"])
    assert np.abs(found - pixels).max() <= 3e-8  # as `half` says


def test_each_plane_is_judged_on_its_own_and_marks_are_exact(tmp_path):
    pixels = np.full((6, 6, 3), 0.01, np.float32)
    clipped = (np.arange(36) % 4).astype(np.uint8).reshape(6, 6)
    with pytest.warns(UserWarning, match="variance is stored as float, not half: 108 of its 108 values"):
        write(tmp_path / "a.exr", RadianceMap(pixels, pixels * np.float32(1e-6), clipped, "cd/m²", {"a": "b"}), HALF)
    assert kinds(tmp_path / "a.exr") == ["float16", "float32", "float16"]
    image = read_radiance(tmp_path / "a.exr")
    assert (image.unit, image.attributes) == ("cd/m²", {"a": "b"})
    assert image.variance is not None
    np.testing.assert_array_equal(image.variance, pixels * np.float32(1e-6))
    np.testing.assert_array_equal(image.clipped, clipped)


def test_bands_of_a_picture_are_all_stored_and_counted(monkeypatch, tmp_path):
    """Q4 and the count of what is lost, where every band holds some of it; and what lies the other way in memory."""
    monkeypatch.setattr(bands, "BAND", 100)
    pixels = np.random.default_rng(5).uniform(0.5, 2, (40, 30, 3)).astype(np.float32)
    pixels[::2, 0, 0] = 1.2345e-6
    with pytest.warns(UserWarning, match="though 20 of its 3600 values"):
        write(tmp_path / "a.exr", RadianceMap(pixels), HALF)
    np.testing.assert_array_equal(
        read_radiance(tmp_path / "a.exr").radiance, pixels.astype(np.float16).astype(np.float32)
    )
    pixels[39, 29, 2] = 1e6
    with pytest.warns(UserWarning, match="1 values are beyond 65504"):
        write(tmp_path / "b.exr", RadianceMap(pixels[::-1, ::-1]), HALF)
    np.testing.assert_array_equal(read_radiance(tmp_path / "b.exr").radiance, pixels[::-1, ::-1])
