"""The sky model against what was published: its tables, and a second implementation of it."""

import struct
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from relume.light.daylight.hosek_wilkie import (
    WAVELENGTHS,
    HosekWilkie,
    _published,
    limb_darkening,
    reflectances,
    to_rgb,
)

MITSUBAS = """
import sys, numpy as np, drjit as dr, mitsuba as mi
mi.set_variant("scalar_spectral")
rows = []
for turbidity, albedo, elevation, *d in np.load(sys.argv[1]):
    towards = [0, float(np.cos(elevation)), float(np.sin(elevation))]
    sky = mi.load_dict({"type": "sunsky", "turbidity": turbidity, "sun_direction": towards, "sun_scale": 0.0,
                        "albedo": {"type": "spectrum", "value": float(albedo)}})
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = -mi.Vector3f(*d)
    row = []
    for some in ((320, 360, 400, 440), (480, 520, 560, 600), (640, 680, 700, 719)):
        si.wavelengths = type(si.wavelengths)(*map(float, some))
        row += [float(x) for x in sky.eval(si)]
    rows.append(row)
np.save(sys.argv[2], rows)
"""


def tensors(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a tensor file of Mitsuba's, float64."""
    data = path.read_bytes()
    assert data[:12] == b"tensor_file\0"
    (count,), place, found = struct.unpack_from("<I", data, 14), 18, {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, place)
        name = data[place + 2 : place + 2 + length].decode()
        axes, kind, begin = struct.unpack_from("<HBQ", data, place + 2 + length)
        place += 13 + length
        shape = struct.unpack_from(f"<{axes}Q", data, place)
        place += 8 * axes
        assert kind == 11
        found[name] = np.frombuffer(data, np.float64, int(np.prod(shape)), begin).reshape(shape)
    return found


def test_its_tables_are_the_published_ones():
    spec = find_spec("mitsuba")
    assert spec is not None and spec.origin is not None
    theirs = tensors(Path(spec.origin).parent / "data" / "sunsky" / "sunsky_datasets.bin")
    ours = _published()
    for mine, name in (("sky", "sky_params"), ("sky_mean", "sky_rad"), ("sun", "sun_rad"), ("limb", "sun_ld")):
        np.testing.assert_allclose(getattr(ours, mine), theirs[f"{name}_spec"], rtol=1e-7)
    # The first numbers of the published file for 320 nm, turbidity 1, albedo 0.
    np.testing.assert_allclose(ours.sky[0, 0, 0, 0, :3], [-1.341049e1, -3.742293, -5.229614], rtol=1e-6)
    np.testing.assert_allclose(ours.limb[6, :2], [0.26892, 1.34319], rtol=1e-6)


def test_the_weights_of_its_bands_are_those_of_the_observer_of_1931():
    # The CIE's ȳ is 1 at 555 nm, and 683 lm/W: an even spectrum over one band's hat is near that at 560 nm.
    luminous = _published().xyz[1]
    np.testing.assert_allclose(luminous.sum(), 683 * 106.86, rtol=2e-3)
    assert np.argmax(luminous) == list(WAVELENGTHS).index(560)
    # A spectrum that is the same everywhere is illuminant E, x = y = 1/3, but for what lies beyond 720 nm.
    xyz = _published().xyz.sum(axis=1)
    np.testing.assert_allclose(xyz / xyz.sum(), [1 / 3] * 3, atol=1e-3)


def test_another_implementation_agrees(tmp_path: Path):
    random = np.random.default_rng(7)
    asked, expected = [], []
    for turbidity in (1.0, 2.0, 3.4, 6.0, 10.0):
        for albedo in (0.0, 0.3, 1.0):
            for elevation in np.radians([0.5, 5.0, 30.0, 85.0]):
                model = HosekWilkie(elevation, turbidity, np.full(11, albedo))
                up, turn = random.uniform(0.01, 1), random.uniform(0, 2 * np.pi)
                level = np.sqrt(1 - up**2)
                direction = np.array([level * np.cos(turn), level * np.sin(turn), up])
                towards = np.array([0, np.cos(elevation), np.sin(elevation)])
                angle = 2 * np.arcsin(np.linalg.norm(direction - towards) / 2)
                asked.append([turbidity, albedo, elevation, *direction])
                expected.append(model.sky(np.array(up), angle))
    np.save(tmp_path / "asked.npy", asked)
    subprocess.run(
        [sys.executable, "-c", MITSUBAS, str(tmp_path / "asked.npy"), str(tmp_path / "found.npy")],
        check=True, timeout=300,
    )  # fmt: skip
    found = np.load(tmp_path / "found.npy")
    assert len(found) == 60
    ours = np.array(expected)
    np.testing.assert_allclose(found[:, :10], ours[:, :10], rtol=1e-4)
    # Between two bands spectra are straight lines; at 720 nm itself Mitsuba reads beyond its table.
    for column, share in ((10, 0.5), (11, 39 / 40)):
        np.testing.assert_allclose(found[:, column], (1 - share) * ours[:, 9] + share * ours[:, 10], rtol=1e-4)


def test_the_sun_dims_and_reddens_towards_the_horizon():
    model = HosekWilkie(0.5, 3.0, np.zeros(11))
    high, low = model.sun(np.radians([60.0, 3.0]))
    assert np.all(high > low)
    assert low[9] / high[9] > 5 * low[3] / high[3]
    assert not model.sun(np.array(-0.01)).any()


def test_through_clear_air_the_sun_is_as_bright_as_air_lets_it_be():
    # Above the air 1.82 W/(m² nm) at 560 nm (ASTM E490); Rayleigh's optical depth there is 0.0906 (Bucholtz 1995) and
    # that of 300 Dobson units of ozone 0.03.
    for elevation in (30.0, 60.0, 90.0):
        mass = 1 / np.sin(np.radians(elevation))
        facing = HosekWilkie(0.5, 1.0, np.zeros(11)).sun(np.radians(elevation))[6] * np.pi * (0.0093 / 2) ** 2
        assert abs(facing / (1.82 * np.exp(-0.12 * mass)) - 1) < 0.06


def test_the_limb_is_darker_and_the_disc_keeps_its_mean():
    radii = np.sqrt((np.arange(20000) + 0.5) / 20000)
    darkening = limb_darkening(radii)
    np.testing.assert_allclose(darkening.mean(axis=0), 1, atol=1e-4)
    assert np.all(np.diff(darkening[:, 3:], axis=0) <= 1e-9)
    # The published middle is 1: at 560 nm the mean is 0.806 of it.
    np.testing.assert_allclose(1 / darkening[0, 6], 0.806, atol=1e-3)


def test_a_coloured_ground_is_that_colour_where_the_bands_are():
    np.testing.assert_allclose(reflectances((0.3, 0.3, 0.3)), 0.3)
    found = reflectances((0.9, 0.5, 0.1))
    np.testing.assert_allclose(found[[0, 3, 6, 9]], [0.1, 0.1, 0.6, 0.9])


def test_an_equal_energy_spectrum_is_slightly_red_in_rec_709():
    red, green, blue = to_rgb(np.ones(11)) / (683 * 106.86)
    assert (round(red, 1), round(green, 2), round(blue, 1)) == (1.2, 0.95, 0.9)


@pytest.mark.parametrize("turbidity", [1.0, 4.5, 10.0])
def test_whole_turbidities_join_without_a_step(turbidity: float):
    up, angle = np.array(0.5), np.array(0.7)
    near = [
        HosekWilkie(0.6, t, np.full(11, 0.2)).sky(up, angle)
        for t in np.clip([turbidity - 1e-7, turbidity + 1e-7], 1, 10)
    ]
    np.testing.assert_allclose(near[0], near[1], rtol=1e-5)
