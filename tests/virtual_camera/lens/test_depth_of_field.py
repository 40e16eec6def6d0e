"""Defocus: apertures from EXIF, discs of confusion, depths of field."""

import numpy as np
import pytest

from relume.image.photograph import Exposure, Photograph, Settings
from relume.virtual_camera.lens.defocus_blur import (
    aperture_from,
    aperture_of,
    depth_of_field,
    disc_of_confusion,
)


def test_the_aperture_is_the_focal_length_over_the_f_number():
    assert aperture_of(2.0, 50.0) == pytest.approx(0.025)
    assert aperture_of(8.0, 46.8916) == pytest.approx(0.00586145)
    for wrong in ((0, 50), (2, -1), (2, np.nan)):
        with pytest.raises(ValueError, match="expected a positive number"):
            aperture_of(*wrong)


def test_a_photograph_tells_its_aperture_where_it_tells_both():
    pixels = np.zeros((2, 2, 3), np.uint8)
    told = Photograph(pixels, exposure=Exposure(1, 2.0), settings=Settings(focal_length=50.0))
    assert aperture_from(told) == pytest.approx(0.025)
    assert aperture_from(Photograph(pixels, settings=Settings(focal_length=50.0))) is None
    assert aperture_from(Photograph(pixels, exposure=Exposure(1, 2.0))) is None
    assert aperture_from(Photograph(pixels, exposure=Exposure(1), settings=Settings(focal_length=50.0))) is None


def test_the_disc_is_what_rays_through_the_rim_of_the_lens_draw():
    # Rays from a point through the rim of a thin lens, followed to the image plane; pixels of 1/1000 of its distance.
    aperture, focus, distance, v = 0.02, 1.5, 0.9, 1000.0
    plane_of_focus = [h * (1 - focus / distance) for h in (-aperture / 2, aperture / 2)]  # of a point on the axis
    expected = v * abs(plane_of_focus[1] - plane_of_focus[0]) / focus
    assert disc_of_confusion(distance, aperture, focus, v) == pytest.approx(expected)
    assert disc_of_confusion(focus, aperture, focus, v) == 0
    assert disc_of_confusion(np.inf, aperture, focus, v) == pytest.approx(aperture * v / focus)
    assert disc_of_confusion(2.0, aperture, np.inf, v) == pytest.approx(aperture * v / 2)
    np.testing.assert_allclose(disc_of_confusion(np.array([1.0, 3.0]), 0.02, 1.5, 1000), [20 / 3, 20 / 3])
    with pytest.raises(ValueError, match="before the camera"):
        disc_of_confusion(-1.0, aperture, focus, v)


def test_at_the_ends_of_the_depth_of_field_the_disc_is_as_wide_as_accepted():
    near, far = depth_of_field(0.01, 1.2, 1000.0, acceptable=2.0)
    assert near < 1.2 < far < np.inf
    for end in (near, far):
        assert disc_of_confusion(end, 0.01, 1.2, 1000.0) == pytest.approx(2.0)
    # From the hyperfocal distance, 0.01 · 1000 / 2 m, all is sharp from its half to infinity.
    near, far = depth_of_field(0.01, 5.0, 1000.0, acceptable=2.0)
    assert far == np.inf and near == pytest.approx(2.5)
    with pytest.raises(ValueError, match="all must be positive"):
        depth_of_field(0, 1, 1000)
