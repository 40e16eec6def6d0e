"""Sequences: what the keys of a shot file mean at a frame, and frames made one by one that can be gone on with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from gltf_files import CORNERS, Channels, animated, as_glb, square_glb
from relume.errors import Doubt, Interrupted, InvalidShot, UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.project.insertion.frame_shots import at_frame, frames_of
from relume.project.insertion.place import turned_light
from relume.project.insertion.sequence import frame_key, make_frames, sparkles
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.sequence_table import SequenceTable, frames_in
from relume.project.shot_file.shot import Shot
from relume.report.write_report import write_report
from relume.sphere.environment_map import EnvironmentMap
from toml_files import SHOT_HEAD, shot_of

SHOT = (
    SHOT_HEAD
    + """\
[sequence]
frames = "1-4"
[[objects]]
mesh = "cube.glb"
translate = [0.0, 5.0, 0.0]
"""
)
KEYS = """
[[objects.keyframes]]
frame = 1
translate = [0, 0, 0]
rotate = [0, 0, 0]
[[objects.keyframes]]
frame = 3
translate = [4, 0, 0]
[[objects.keyframes]]
frame = 5
rotate = [0, 360, 0]
[[light.keyframes]]
frame = 0
turn = 0
exposure = 1
[[light.keyframes]]
frame = 10
turn = 720
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "cube.glb").write_bytes(square_glb())
    (tmp_path / "plate.exr").write_bytes(b"a plate")
    (tmp_path / "light.exr").write_bytes(b"a light")
    return tmp_path


@pytest.mark.parametrize(
    ("text", "frames"),
    [("1-4", [1, 2, 3, 4]), ("1-9x4", [1, 5, 9]), ("1-8x4", [1, 5]), ("5,7, 9", [5, 7, 9]), ("0", [0]),
     ("10-12,3,11", [3, 10, 11, 12])],
)  # fmt: skip
def test_frames_are_listed_as_renderers_list_them(text, frames):
    assert list(SequenceTable.model_validate({"frames": text}).frames) == frames


@pytest.mark.parametrize("text", ["", "a", "1-", "-3", "4-1", "1-4x0", "1,,2", "1.5", "1-99999999999", "1 2"])
def test_frames_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match=r"is no frame|has no frames|more than"):
        frames_in(text)


def test_keys_are_interpolated_each_value_by_those_that_say_it(folder):
    shot = shot_of(folder, SHOT + KEYS)
    there = at_frame(shot, 2)
    assert there.objects[0].translate == pytest.approx((2, 0, 0))
    assert there.objects[0].rotate == pytest.approx((0, 90, 0))
    assert there.objects[0].scale == 1.0
    assert (there.light.turn, there.light.exposure) == pytest.approx((144, 1))
    assert at_frame(shot, 4).objects[0].translate == pytest.approx((4, 0, 0))
    assert at_frame(shot, 2.5).objects[0].rotate == pytest.approx((0, 135, 0))
    still = at_frame(shot_of(folder, SHOT), 3)
    assert still.objects[0].translate == (0.0, 5.0, 0.0)


def test_a_frame_is_a_plain_shot(folder):
    there = at_frame(shot_of(folder, SHOT + KEYS), 2)
    assert there.sequence is None
    assert not there.objects[0].keyframes and not there.light.keyframes and not there.camera.keyframes
    with pytest.raises(InvalidShot, match="sequence: missing"):
        frames_of(there)


@pytest.mark.parametrize(("way", "x"), [("linear", 2.0), ("step", 0.0), ("smooth", 2.0)])
def test_the_interpolation_is_the_files(folder, way, x):
    text = SHOT.replace('"1-4"', f'"1-4"\ninterpolation = "{way}"') + KEYS
    assert at_frame(shot_of(folder, text), 2).objects[0].translate[0] == pytest.approx(x)


def test_motion_in_a_file_begins_with_the_sequence(folder):
    from scipy.spatial.transform import Rotation

    turns = [[0, 0, 0, 1], [0, np.sqrt(0.5), 0, np.sqrt(0.5)]]
    channels: Channels = [(0, "rotation", [0, 0.125], turns, "LINEAR")]
    (folder / "cube.glb").write_bytes(as_glb(*animated(channels, [{"name": "square", "mesh": 0}])))
    shot = shot_of(folder, SHOT.replace('"1-4"', '"3-6"'))
    assert at_frame(shot, 3).objects[0].time == 0.0 and at_frame(shot, 6).objects[0].time == 0.125
    (rest,) = placed_meshes(shot)
    height = np.array([0.0, 5.0, 0.0])
    (turned,) = placed_meshes(at_frame(shot, 6))
    expected = Rotation.from_rotvec([0, np.pi / 2, 0]).apply(rest.vertices - height) + height
    assert turned.vertices == pytest.approx(expected, abs=1e-6)


def test_a_camera_that_moves_needs_plates_that_do(folder):
    keys = "".join(f"\n[[camera.keyframes]]\nframe = {f}\nposition = [{f - 1}, 1, 3]\n" for f in (1, 5))
    with pytest.raises(InvalidShot, match=r"camera\.keyframes: the plate is one photograph"):
        frames_of(shot_of(folder, SHOT + keys))
    text = SHOT.replace('"1-4"', '"1-4"\nplates = "pan_*.exr"') + keys
    for number in (1, 2, 4, 10):
        (folder / f"pan_{number}.exr").write_bytes(b"")
    with pytest.raises(InvalidShot, match=r"sequence\.plates: no picture has the number of frame 3; the last number"):
        frames_of(shot_of(folder, text))
    (folder / "pan_3.exr").write_bytes(b"")
    shot = shot_of(folder, text)
    assert frames_of(shot) == [1, 2, 3, 4]
    there = at_frame(shot, 3)
    assert there.plate.photographs == ["pan_3.exr"]
    assert there.camera.pose is not None
    assert there.camera.pose.position == pytest.approx((2, 1, 3)) and there.camera.pose.look_at == (0, 0, 0)
    (folder / "pan_03.exr").write_bytes(b"")
    with pytest.raises(InvalidShot, match="are both frame 3"):
        frames_of(shot)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('frames = "4-1"', "sequence.frames: '4-1' has no frames"),
        ("frames = []", "sequence.frames: 0 frames"),
        ("frames = [-1]", "sequence.frames: 1 frames"),
        ('frames = "1"\nshutter = [0.5, 0.1]', "shutter is"),
        ('frames = "1"\nrates = 4', "unknown key; did you mean rate"),
    ],
)
def test_wrong_tables_are_reported_by_their_keys(folder, change, words):
    with pytest.raises(InvalidShot, match=words):
        shot_of(folder, SHOT.replace('frames = "1-4"', change))


def test_keys_out_of_order_are_refused(folder):
    with pytest.raises(InvalidShot, match="frame 1 comes after 3; give them in rising order"):
        shot_of(folder, SHOT + KEYS.replace("frame = 5", "frame = 1"))


def test_a_value_that_keys_make_but_no_file_may_have_is_reported_with_its_frame(folder):
    keys = "".join(
        f"\n[[objects.keyframes]]\nframe = {f}\nscale = {s}\n" for f, s in ((1, 9), (2, 0.01), (4, 0.01), (5, 9))
    )
    text = SHOT.replace('"1-4"', '"1-4"\ninterpolation = "smooth"') + keys
    with pytest.raises(InvalidShot, match=r"objects.0.scale: at frame 3 the keys make it -.*add a key there"):
        at_frame(shot_of(folder, text), 3)


def test_the_light_turns_counter_clockwise_seen_from_above_and_grows_by_stops():
    radiance = np.zeros((32, 64, 3), np.float32)
    radiance[15:17, 31:33] = 1  # towards −Z
    light = turned_light(EnvironmentMap(radiance), 90.0, 1.0)
    # A quarter turn about +Y takes −Z to −X.
    assert light.lookup(np.array([-1.0, 0, 0])).max() > 1.5 and light.lookup(np.array([0, 0, -1.0])).max() < 0.01
    assert light.total() == pytest.approx(2 * EnvironmentMap(radiance).total(), rel=1e-3)
    assert turned_light(light, 720.0, 0.0) is light


# Making them


class Maker:
    """A fake job that writes a flat picture whose brightness says where the object is, and counts its calls."""

    def __init__(self, stop_at: float | None = None) -> None:
        self.made: list[float] = []
        self.others: list[tuple[Path, ...]] = []
        self.stop_at = stop_at

    def __call__(self, shot: Shot, folder: Path, others: tuple[Path, ...]) -> Sequence[Doubt]:
        x = shot.objects[0].translate[0]
        if x == self.stop_at:
            raise Interrupted(3, 16, 2, folder)
        self.made.append(x)
        self.others.append(others)
        folder.mkdir(parents=True, exist_ok=True)
        files.write(folder / "composite.png", Photograph(np.full((16, 24, 3), int(20 * x), np.uint8)))
        return [Doubt("the same everywhere"), *([Doubt("dark")] if x == 0 else [])]


def test_every_frame_is_made_once_and_a_second_run_makes_none(folder, tmp_path):
    shot, out, maker = shot_of(folder, SHOT + KEYS), tmp_path / "out", Maker()
    first = make_frames(shot, out, maker)
    assert maker.made == pytest.approx([0, 2, 4, 4])
    assert maker.others == [(), (out / "frame_0001" / "stages",),
                            (out / "frame_0001" / "stages", out / "frame_0002" / "stages"),
                            (out / "frame_0001" / "stages", out / "frame_0003" / "stages")]  # fmt: skip
    assert sorted(p.name for p in out.iterdir()) == [
        "frame_0001", "frame_0002", "frame_0003", "frame_0004", "sequence.json", "sequence.mp4",
    ]  # fmt: skip
    assert first.notes == ("the same everywhere", "frame 1: dark")
    again = make_frames(shot, out, Maker())
    assert [frame.kept for frame in again.frames] == [True] * 4
    assert again.notes == first.notes
    write_report(again, out)
    page = (out / "report.html").read_text()
    assert page.count("kept from before") == 4 and page.count("data:image/png") == 4 and "dark" in page


def test_an_interrupted_sequence_is_resumed(folder, tmp_path):
    shot, out = shot_of(folder, SHOT + KEYS.replace("[4, 0, 0]", "[3, 0, 0]")), tmp_path / "out"
    with pytest.raises(Interrupted):
        make_frames(shot, out, Maker(stop_at=1.5))
    assert not (out / "sequence.mp4").exists()
    maker = Maker()
    done = make_frames(shot, out, maker)
    assert maker.made == pytest.approx([1.5, 3, 3]) and [frame.kept for frame in done.frames] == [True] + [False] * 3


@pytest.mark.parametrize("error", [UnreadableFile("oak.glb: no such file"), ValueError("oak.glb: no such file")])
def test_an_error_inside_a_frame_names_the_frame(folder, tmp_path, error):
    shot = shot_of(folder, SHOT + KEYS)

    def make(frame: Shot, folder: Path, others: tuple[Path, ...]) -> Sequence[Doubt]:
        if frame.objects[0].translate[0] > 3:
            raise error
        return Maker()(frame, folder, others)

    with pytest.raises(type(error), match=r"^frame 3: oak\.glb: no such file$"):
        make_frames(shot, tmp_path / "out", make)
    assert (tmp_path / "out" / "frame_0002" / "frame.json").is_file()


def test_a_frame_that_is_not_whole_or_of_other_files_is_made_again(folder, tmp_path):
    shot, out = shot_of(folder, SHOT + KEYS), tmp_path / "out"
    make_frames(shot, out, Maker())
    (out / "frame_0002" / "composite.png").unlink()
    (out / "frame_0003" / "composite.png").write_bytes(b"cut")
    (out / "frame_0004" / "frame.json").write_text("{")
    maker = Maker()
    make_frames(shot, out, maker)
    assert maker.made == pytest.approx([2, 4, 4])
    (folder / "plate.exr").write_bytes(b"another")
    maker = Maker()
    make_frames(shot, out, maker)
    assert len(maker.made) == 4


def test_a_frame_depends_on_its_files_and_its_moment_only(folder):
    shot = shot_of(folder, SHOT + KEYS)
    keys = [frame_key(at_frame(shot, frame)) for frame in (1, 2, 2)]
    assert keys[0] != keys[1] == keys[2]
    longer = shot_of(folder, SHOT.replace("1-4", "1-9") + KEYS)
    assert frame_key(at_frame(longer, 2)) == keys[1]
    (folder / "cube.glb").write_bytes(square_glb(node={"translation": [1, 0, 0]}))
    assert frame_key(at_frame(shot, 2)) != keys[1]


def test_a_gltf_depends_on_what_it_names(folder):
    (folder / "keys.bin").write_bytes(b"1")
    (folder / "cube.gltf").write_text('{"buffers": [{"uri": "keys.bin"}]}')
    shot = shot_of(folder, SHOT.replace("cube.glb", "cube.gltf"))
    before = frame_key(shot)
    (folder / "keys.bin").write_bytes(b"2")
    assert frame_key(shot) != before


def test_the_movie_shows_the_frames_in_order_at_the_rate_asked_for(folder, tmp_path):
    av = pytest.importorskip("av")
    shot = shot_of(folder, SHOT.replace('"1-4"', '"1-4"\nrate = 30') + KEYS)
    made = make_frames(shot, tmp_path / "out", Maker())
    assert made.movie is not None
    with av.open(str(made.movie)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == 30
        means = [frame.to_ndarray(format="rgb24").mean() for frame in container.decode(stream)]
    assert means == pytest.approx([0, 40, 80, 80], abs=3)


def test_a_sparkle_stands_out_of_its_neighbours_and_a_passing_edge_does_not():
    before, frame, after = (np.full((10, 10, 3), 80, np.uint8) for _ in range(3))
    frame[2, 3] = 255
    assert sparkles(before, frame, after) == 0.01
    frame[2, 3] = 80
    after[:, :5] = frame[:, :3] = 200
    assert sparkles(before, after, frame) == 0.2 and sparkles(before, frame, after) == 0.0


def test_what_is_wrong_in_a_frame_is_wrong_in_the_sequence(folder, tmp_path):
    def make(shot: Shot, place: Path, others: tuple[Path, ...]) -> Sequence[Doubt]:
        place.mkdir(parents=True)
        (place / "made").write_bytes(b"1")
        number = int(place.name[-1])
        return [Doubt("everywhere", 0.1 * number), *([Doubt("unseen", 1.0)] if number == 3 else [])]

    shot = shot_of(folder, SHOT + KEYS)
    made = make_frames(shot, tmp_path / "out", make)
    assert made.doubts == (Doubt("frame 3: unseen", 1.0), Doubt("everywhere", 0.4))
    assert [each.wrong for each in made.doubts] == [True, True]
    # Also where the frames were made by an earlier run.
    assert make_frames(shot, tmp_path / "out", make).doubts == made.doubts


def test_a_frame_depends_on_whether_its_surface_is_described(folder):
    short = SHOT.replace(
        "pose = { position = [0, 1, 3], look_at = [0, 0, 0] }\n", "ball.rim = [5, 6, 2]\nball.radius = 0.05\n"
    )
    whole = short + '[[local]]\nshape = "plane"\n'
    assert shot_of(folder, short).surfaces() != shot_of(folder, whole).surfaces()
    assert frame_key(shot_of(folder, short)) != frame_key(shot_of(folder, whole))


def test_an_object_stands_still_in_size_while_it_moves(folder):
    shot = shot_of(folder, SHOT)
    times = [0.0, 0.125]
    moves: Channels = [(0, "translation", times, [[0, 0, 0], [2, 1, 0]], "LINEAR"),
                       (0, "scale", times, [[1, 1, 1], [3, 3, 3]], "LINEAR")]  # fmt: skip
    (folder / "cube.glb").write_bytes(as_glb(*animated(moves, [{"name": "square", "mesh": 0}])))
    shot = shot_of(folder, SHOT.replace('"1-4"', '"3-6"') + "size = 0.5\nstand = [0.0, 0.0]\n")
    (rest,), (moved,) = (placed_meshes(at_frame(shot, frame)) for frame in (3, 6))
    assert np.ptp(rest.vertices, axis=0).max() == pytest.approx(0.5)
    assert np.ptp(moved.vertices, axis=0).max() == pytest.approx(1.5)
    # It leaves its place by what the file moves it, at its size.
    scale = 0.5 / np.ptp(CORNERS, axis=0).max()
    expected = scale * (3 * CORNERS + [2, 1, 0]) - scale * CORNERS
    assert moved.vertices - rest.vertices == pytest.approx(expected, abs=1e-6)


def test_a_key_at_the_origin_stands_an_object_nowhere_else(folder):
    ball = SHOT.replace(
        "pose = { position = [0, 1, 3], look_at = [0, 0, 0] }\n", "ball.rim = [5, 6, 2]\nball.radius = 0.05\n"
    )
    shot = shot_of(folder, ball + KEYS)
    (first,), (second,) = (placed_meshes(at_frame(shot, frame)) for frame in (1, 1 + 1e-6))
    assert first.vertices == pytest.approx(second.vertices, abs=1e-4)
