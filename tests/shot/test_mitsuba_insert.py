"""The job with the real renderer, small: what the objects leave alone stays the plate to the bit, however rendered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.shot.insert import insert
from relume.shot.project import Shot
from relume.sphere.illumination import IlluminationMap, as_radiance_map

OBJECT = Path(__file__).parents[2] / "examples/room/objects/cube_gold.glb"


@pytest.fixture
def small_shot(tmp_path: Path) -> Shot:
    """A plate of random radiance over a plane, under a light with a bright half."""
    generator = np.random.default_rng(3)
    write(tmp_path / "plate.exr", RadianceMap(generator.uniform(0.2, 0.4, (48, 64, 3)).astype(np.float32)))
    light = np.ones((16, 32, 3), np.float32)
    light[:, 20:28] = 4
    write(tmp_path / "light.exr", as_radiance_map(IlluminationMap(light)))
    return Shot.model_validate(
        {
            "plate": {"photographs": ["plate.exr"]},
            "camera": {"pose": {"position": [0.2, 0.6, 1.0], "look_at": [0.2, 0.0, 0.1]}, "focal_length": 40},
            "light": {"map": "light.exr"},
            "objects": [{"mesh": str(OBJECT)}],
            "folder": tmp_path,
        }
    )


@pytest.mark.parametrize("denoise", [False, True])
@pytest.mark.parametrize("noise", [None, 0.2])
def test_a_real_render_leaves_the_plate_to_the_bit_where_nothing_changed(
    small_shot: Shot, tmp_path: Path, noise: float | None, denoise: bool
) -> None:
    table = small_shot.render.model_copy(update={"samples": 64, "noise": noise, "denoise": denoise})
    result = insert(small_shot.model_copy(update={"render": table}), tmp_path / "out")
    outside = result.with_.matte == 0
    equal = np.all(result.with_.radiance == result.without.radiance, axis=-1)
    # The upper rows look past the cube: the same rays find the same light.
    assert equal[outside].mean() > 0.3
    assert np.array_equal(result.composite[outside & equal], result.plate.radiance[outside & equal])
    assert result.without.passes == result.with_.passes
    assert np.abs(result.with_.radiance - result.without.radiance)[result.with_.matte > 0.9].mean() > 0.05


def test_an_object_out_of_the_picture_is_told(small_shot: Shot, tmp_path: Path) -> None:
    moved = [small_shot.objects[0].model_copy(update={"translate": (0.0, 0.0, 50.0)})]
    table = small_shot.render.model_copy(update={"samples": 16})
    result = insert(small_shot.model_copy(update={"render": table, "objects": moved}), tmp_path / "out")
    assert any("no object is seen" in note for note in result.notes)
