"""Two balls beside a real subject in one frame: the published photographs' own crops put side by side again."""

from pathlib import Path

import numpy as np
import pytest

from angles import degrees_between
from relume.image.files import read_photograph, write
from relume.image.photograph import Photograph
from relume.lightstage.acquire.import_lights import stage_of_balls
from relume.lightstage.acquire.light_files import read_directions

OLAT = Path(__file__).resolve().parents[4] / "shared" / "data" / "olat" / "gray_balls_psdata"


def frame(folder: Path, name: str, index: int) -> np.ndarray:
    """Both balls' crops with the subject between them."""
    left, right = (read_photograph(folder / f"LightProbe-{k}" / f"{name}.JPG").pixels[::3, ::3] for k in (1, 2))
    subject = read_photograph(folder / "Objects" / f"Image_{index:02d}.png").pixels[::2, ::2]
    picture = np.zeros((460, left.shape[1] + subject.shape[1] + right.shape[1], 3), np.uint8)
    for part, x in ((left, 0), (subject, left.shape[1]), (right, left.shape[1] + subject.shape[1])):
        picture[: part.shape[0], x : x + part.shape[1]] = part
    return picture


@pytest.mark.slow
@pytest.mark.parametrize("room", [False, True])
@pytest.mark.parametrize("thing", ["cat", "frog"])
def test_two_balls_beside_a_subject_are_found_in_jpegs_and_show_the_published_lights(thing, room, tmp_path):
    folder = OLAT / thing
    if not folder.is_dir():
        pytest.skip("the real sets are not beside the repository")
    for index in range(1, 21):
        picture = frame(folder, f"Image_{index:02d}", index)
        write(tmp_path / f"shot_{index:02d}.jpg", Photograph(picture))
    if room:
        write(tmp_path / "room.jpg", Photograph(frame(folder, "ref", 1)))
    stage, found = stage_of_balls(tmp_path, ("find", "find"), (), None, [tmp_path / "room.jpg"] if room else ())
    for number, (x, _, radius) in enumerate(found.circles, 1):
        across, _, wide = np.loadtxt(folder / f"LightProbe-{number}" / "circle_data.txt") / 3
        offset = 0 if number == 1 else picture.shape[1] - 400
        assert abs(x - offset - across) < 0.03 * radius and abs(radius - wide) < 0.03 * radius
    directions = np.array([entry.direction for entry in stage.lights])
    away = degrees_between(directions, read_directions(folder / "light_directions.txt"))
    assert away.max() < 2 and max(found.disagreement) < np.radians(2)
