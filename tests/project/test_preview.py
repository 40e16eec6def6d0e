"""The picture so far."""

import numpy as np
import pytest

from relume.image.files import read_photograph, read_radiance
from relume.image.radiance import RadianceMap
from relume.project.insertion.render_change import Previews
from relume.renderers.progressive.accumulation import RenderSession, accumulate
from relume.renderers.progressive.convergence import Sums
from relume.virtual_camera.film.film import Film

PLATE = np.full((4, 6, 3), 2.0, np.float32)


def passing(seed: int) -> dict[str, np.ndarray]:
    objects, difference, matte = np.zeros((4, 6, 3)), np.zeros((4, 6, 3)), np.zeros((4, 6))
    objects[0, 0], matte[0, 0] = 0.25, 0.5
    difference[1, 1] = -1.5
    return {"objects": objects, "difference": difference, "matte": matte}


def test_it_is_the_composite_of_what_there_is(tmp_path):
    previews = Previews(tmp_path, RadianceMap(PLATE), Film(1.0))
    accumulate(passing, passes=3, watch=RenderSession(preview=previews))
    picture = read_radiance(tmp_path / "preview.exr").radiance
    assert [picture[i, i].tolist() for i in range(3)] == [[1.25] * 3, [0.5] * 3, [2.0] * 3]
    assert (read_photograph(tmp_path / "preview.png").pixels[1, 1] == 188).all()  # sRGB of one half
    assert sorted(p.name for p in tmp_path.iterdir()) == ["preview.exr", "preview.png"]
    previews.remove()
    assert list(tmp_path.iterdir()) == []


def test_a_preview_that_cannot_be_written_is_reported_and_stops_nothing(tmp_path):
    previews = Previews(tmp_path / "nowhere", RadianceMap(PLATE), Film(1.0))
    with pytest.warns(UserWarning, match="no preview: .*nowhere"):
        sums = accumulate(passing, passes=2, watch=RenderSession(preview=previews))
    assert isinstance(sums, Sums) and sums.passes == 2
