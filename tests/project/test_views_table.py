"""`[[views]]`: further photographs of the real surfaces in a shot file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidShot
from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.project.insertion.insert import insert
from relume.renderers.mitsuba.differential import Differential
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from toml_files import shot_of

CUBE = Path(__file__).parents[2] / "examples/room/objects/cube_gold.glb"
SHOT = f"""
[plate]
photographs = "plate.exr"
[camera]
pose = {{ position = [0, 0.8, 1.0], look_at = [0, 0, 0] }}
focal_length = 60
[light]
map = "light.exr"
[match]
sharpness = false
grain = false
[[local]]
shape = "plane"
[[objects]]
mesh = "{CUBE}"
size = 0.1
[render]
preview = false
samples = 4
"""
VIEW = """[[views]]
photograph = "side.exr"
map = "dim.exr"
camera = { pose = { position = [0, 0.8, 1.0], look_at = [0, 0, 0] }, focal_length = 60 }
"""
ALBEDO = np.array([0.4, 0.3, 0.2])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A table under an even light, and again under half of it, each with its own noise."""
    for name, light, seed in (("plate", 1.0, 1), ("side", 0.5, 2)):
        noise = 0.04 * np.random.default_rng(seed).normal(size=(32, 48, 3))
        write(tmp_path / f"{name}.exr", RadianceMap((light * ALBEDO * (1 + noise)).astype(np.float32)))
    for name, light in (("light", 1.0), ("dim", 0.5)):
        write(tmp_path / f"{name}.exr", as_radiance_map(EnvironmentMap(np.full((8, 16, 3), light, np.float32))))
    return tmp_path


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_second_photograph_halves_the_noise_of_the_reflectance(folder):
    renderer = Differential(samples=4, depth=2)
    one = insert(shot_of(folder, SHOT), folder / "one", renderer=renderer).place.recovered
    two = insert(shot_of(folder, SHOT + VIEW), folder / "two", renderer=renderer).place.recovered
    assert one is not None and two is not None
    np.testing.assert_allclose(np.median(two.albedo, axis=(0, 1)), ALBEDO, rtol=0.02)
    # Of independent noise half the variance is left.
    inside = (slice(4, -4), slice(4, -4))
    spread = [float(np.std(each.albedo[inside][..., 0])) for each in (one, two)]
    assert 0.6 < spread[1] / spread[0] < 0.85


@pytest.mark.parametrize(
    ("view", "words"),
    [
        (VIEW.replace('"side.exr"', '"none.exr"'), r"views.0: .*none\.exr"),
        (
            VIEW.replace('map = "dim.exr"', 'map = "dim.exr"\nprobe = [0, 1, 0]'),
            "views.0: probe says nothing of a distant",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_photograph_that_cannot_be_used_is_refused_in_one_line(folder, view, words):
    with pytest.raises(InvalidShot, match=words) as caught:
        insert(shot_of(folder, SHOT + view), folder / "out", renderer=Differential(samples=4, depth=2))
    assert "\n" not in str(caught.value)


def test_a_probe_without_a_map_is_refused(folder):
    with pytest.raises(InvalidShot, match=r"views\.0: probe is the place of a map"):
        shot_of(folder, SHOT + VIEW.replace('map = "dim.exr"', "probe = [0, 1, 0]"))
