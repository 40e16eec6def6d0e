"""What other programs get of surfaces that they have not."""

from __future__ import annotations

import numpy as np
import pytest

from relume.errors import UnsupportedScene
from relume.export.parts import physical
from relume.scene.materials.abc_facets import MERL_FITS
from relume.scene.materials.materials import Material, Ward
from relume.scene.materials.measured import MeasuredBRDF


@pytest.mark.parametrize(
    "material", [MERL_FITS["merl/teflon"], MeasuredBRDF(np.ones((2, 2, 2, 3), np.float32), "felt")]
)
def test_a_measured_surface_is_refused_by_name(material):
    with pytest.raises(
        UnsupportedScene, match=f"ball: other programs have no measured surface as '{material.name}' is"
    ):
        physical(material, "ball")


def test_scratches_from_images_are_a_rough_metal_of_their_means():
    image = np.full((2, 2, 3), 0.3, np.float32)
    image[0] = 0.5
    made, lost = physical(Ward(image, np.full((2, 2), 0.16, np.float32), 0.01, (0.1, 0.1, 0.1), name="tin"), "ball")
    assert isinstance(made, Material) and made.base_color == pytest.approx((0.5, 0.5, 0.5))
    # α = √(0.16·0.01) = 0.04, roughness its root; four fifths of what it reflects is gloss.
    assert (made.roughness, made.metallic) == pytest.approx((0.2, 0.8))
    assert len(lost) == 1 and "Ward's surface is written as a rough metal" in lost[0]
