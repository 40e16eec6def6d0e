"""Single photographs as views of a panorama: the same light and the same marks as a ball's photograph gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relume.capture.response.camera_profile import CameraProfile
from relume.image.files import read_photograph, write
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, SATURATED
from relume.image.response import Response
from relume.probe.clipped_light import linear
from relume.probe.panorama.view_files import read_sources


def test_a_photograph_is_read_by_the_rule_for_all_single_ones(tmp_path: Path) -> None:
    # 250/255 of 16 bits is 64250: what is below it was measured.
    codes = np.array([[0, 1, 30000, 64240, 64250, 65535]], np.uint16)
    write(tmp_path / "view.png", Photograph(np.repeat(codes[..., None], 3, axis=-1)))
    line = np.linspace(0, 1, 256)
    squared = Response(np.repeat(2 * np.log(np.maximum(line, 1e-6))[None], 3, axis=0), np.zeros((3, 256)))
    for response in (None, squared):
        (source,) = read_sources([tmp_path / "view.png"], profile=response and CameraProfile("", response))
        expected = linear(read_photograph(tmp_path / "view.png"), response)
        assert source.picture.clipped is not None and expected.clipped is not None
        assert source.picture.clipped.tolist() == [[BLACK, 0, 0, 0, SATURATED, SATURATED]]
        assert np.array_equal(source.picture.clipped, expected.clipped)
        assert np.array_equal(source.picture.radiance, expected.radiance)
        assert source.assumed == (response is None)
    # A curve of 256 values serves 16 bits: √ of the light.
    assert abs(source.picture.radiance[0, 2, 0] / (30000 / 65535) ** 2 - 1) < 1e-4
