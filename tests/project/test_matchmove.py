"""Matchmoved plates: films and cameras that go together, and objects that stay where they stand, to 0.1 pixels."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from gltf_files import moving_gltf
from matchmoves import CENTRE, HEIGHT, RADIUS, RATE, WIDTH, Matchmove, middle_of
from relume.errors import DoubtWarning, InvalidShot, UnreadableFile
from relume.image import files
from relume.image.files.video import Movie, read_video_frame
from relume.project.insertion import insert_frames as making
from relume.project.insertion.frame_shots import at_frame, frames_of
from relume.project.insertion.insert_frames import insert_frames, shutter_of, with_steady_light
from relume.project.insertion.photographs import read_photographs
from relume.project.shot_file.camera_table import camera_fit
from relume.project.shot_file.shot import Shot, read_shot
from toml_files import shot_of

SIZE = (WIDTH, HEIGHT)
PLATES = range(101, 113)


def seen_by(shot: Shot, frame: int, fine: int) -> np.ndarray:
    """The share of each pixel (H, W) that the ball covers, by the rays of the shot's camera."""
    camera = camera_fit(at_frame(shot, frame).camera, SIZE, shot.folder, None).camera
    x, y = (np.arange(n * fine) + 0.5 for n in SIZE)
    points = np.stack(np.meshgrid(x / fine, y / fine), axis=-1)
    way, rays = CENTRE - camera.eyes(points), camera.rays_through(points)
    along = np.sum(way * rays, axis=-1, keepdims=True)
    met = np.linalg.norm(way - along * rays, axis=-1) < RADIUS
    return met.reshape(HEIGHT, fine, WIDTH, fine).mean((1, 3))


def residual(filmed: dict[int, np.ndarray], shot: Shot, fine: int = 1) -> float:
    """Pixels, rms over the frames, between where the ball is filmed and where the shot's camera sees it."""
    apart = [middle_of(seen_by(shot, frame, fine)) - middle for frame, middle in filmed.items()]
    return float(np.sqrt(np.mean(np.sum(np.square(apart), axis=1))))


def track(folder: Path, move: Matchmove, camera: str) -> Shot:
    """A shot of empty plates."""
    (folder / "track.chan").write_text(move.chan(range(100, 114)))
    for frame in PLATES:
        (folder / f"plate_{frame}.png").write_bytes(b"")
    text = f"""
[plate]
photographs = "plate_101.png"
[camera]
file = "track.chan"
{camera}
[light]
map = "light.exr"
[sequence]
frames = "101-112"
plates = "plate_*.png"
"""
    (folder / "light.exr").write_bytes(b"")
    shot = shot_of(folder, text)
    assert frames_of(shot) == list(PLATES)
    return shot


BENT = "distortion = { k1 = -0.12, k2 = 0.03 }"


def test_the_cameras_of_a_film_see_the_ball_where_it_was_filmed_to_a_tenth_of_a_pixel(tmp_path):
    move = Matchmove(readout=0.02, lens=True)
    filmed = {frame: middle_of(move.seen(frame)[1]) for frame in range(101, 113, 4)}
    assert residual(filmed, track(tmp_path, move, f"readout = 0.02\n{BENT}"), fine=4) < 0.03
    # What each of the three is worth.
    assert residual(filmed, track(tmp_path, move, BENT)) > 0.5
    assert residual(filmed, track(tmp_path, move, "readout = 0.02")) > 0.1
    shot = track(tmp_path, move, f"readout = 0.02\n{BENT}")
    late = shot.model_copy(update={"camera": shot.camera.model_copy(
        update={"file": shot.camera.file and shot.camera.file.model_copy(update={"offset": 1.0})})})  # fmt: skip
    assert residual(filmed, late) > 3


def test_each_frame_has_its_own_plate_camera_and_grain(tmp_path):
    shot = track(tmp_path, Matchmove(), "")
    first, third = at_frame(shot, 101), at_frame(shot, 103)
    assert (first.plate.photographs, third.plate.photographs) == (["plate_101.png"], ["plate_103.png"])
    assert first.camera.file is not None and third.camera.file is not None
    assert (first.camera.file.frame, third.camera.file.frame) == (101, 103)
    assert first.match.seed != third.match.seed and at_frame(shot, 101).match.seed == first.match.seed
    # Still plates keep the grain that the plate keeps.
    still = shot_of(tmp_path, VIDEO.partition("plates")[0].format("1-3"))
    assert at_frame(still, 1).match.seed == at_frame(still, 2).match.seed == 0


def test_numbers_of_plates_and_cameras_are_matched_by_offsets(tmp_path):
    (tmp_path / "track.chan").write_text(Matchmove().chan(range(1001, 1004)))
    for frame in (11, 12, 13):
        (tmp_path / f"p_{frame}.exr").write_bytes(b"")
    text = """
[plate]
photographs = "p_11.exr"
[camera]
file = {{ path = "track.chan", offset = {} }}
[light]
map = "p_11.exr"
[sequence]
frames = "1-3"
plates = "p_*.exr"
offset = {}
"""
    shot = shot_of(tmp_path, text.format(1000, 10))
    assert frames_of(shot) == [1, 2, 3]
    there = at_frame(shot, 2)
    assert there.plate.photographs == ["p_12.exr"] and there.camera.file is not None
    assert there.camera.file.frame == 1002
    with pytest.raises(InvalidShot, match=r"track\.chan has the frames 1001 to 1003, and the sequence asks for 1 to 3"):
        frames_of(shot_of(tmp_path, text.format(0, 10)))
    with pytest.raises(InvalidShot, match=r"no picture has the number of frame 1, sequence\.offset 9 added; the last"):
        frames_of(shot_of(tmp_path, text.format(1000, 9)))


def test_a_track_of_another_rate_goes_by_time(tmp_path):
    shot = track(tmp_path, Matchmove(), "")
    asked = shot.camera.file
    assert asked is not None
    double = asked.model_copy(update={"rate": 48.0}).at(103, 101, 24.0)
    assert double.frame == 105


def test_a_camera_of_gltf_moves_from_the_sequences_first_frame_and_must_move_as_long(tmp_path):
    moving_gltf(tmp_path / "moving.gltf")  # 2 s
    for frame in range(5, 60):
        (tmp_path / f"p_{frame}.exr").write_bytes(b"")
    text = """
[plate]
photographs = "p_5.exr"
[camera]
file = "moving.gltf"
[light]
map = "p_5.exr"
[sequence]
frames = "5-{}"
plates = "p_*.exr"
"""
    shot = shot_of(tmp_path, text.format(53))
    assert frames_of(shot)[-1] == 53
    camera = camera_fit(at_frame(shot, 29).camera, (300, 200), tmp_path, None).camera
    np.testing.assert_allclose(camera.position, [1, 1, 0], atol=1e-9)
    with pytest.raises(InvalidShot, match=r"moving\.gltf moves for 49 frames, and the sequence has 51"):
        frames_of(shot_of(tmp_path, text.format(55)))


def film(path: Path, frames: int, rate: float = RATE) -> Path:
    with Movie(path, rate) as movie:
        for index in range(frames):
            movie.add(np.full((32, 48, 3), 40 + 10 * index, np.uint8))
    return path


VIDEO = """
[plate]
photographs = "film.mp4"
[camera]
pose = {{ position = [0, 1, 1], look_at = [0, 0, 0] }}
focal_length = 50
[light]
map = "light.exr"
[sequence]
frames = "{}"
plates = "film.mp4"
"""


def test_a_video_gives_the_plate_of_each_frame(tmp_path):
    film(tmp_path / "film.mp4", 6)
    (tmp_path / "light.exr").write_bytes(b"")
    shot = shot_of(tmp_path, VIDEO.format("1-6"))
    assert frames_of(shot) == [1, 2, 3, 4, 5, 6]
    there = at_frame(shot, 4)
    assert there.plate.photographs == ["film.mp4"] and there.plate.frame == 4
    (read,) = read_photographs(there).plate.photographs  # pyright: ignore[reportAttributeAccessIssue]
    assert abs(int(read.pixels[9, 9, 1]) - 70) <= 1 and read.size == (48, 32) and "frame 4" in read.name


def test_films_that_do_not_fit_are_refused_in_one_line(tmp_path):
    film(tmp_path / "film.mp4", 6)
    (tmp_path / "light.exr").write_bytes(b"")
    with pytest.raises(InvalidShot, match=r"film\.mp4 has 6 frames, and frame 7 would be its 7; give fewer frames"):
        frames_of(shot_of(tmp_path, VIDEO.format("5-8")))
    with pytest.raises(InvalidShot, match=r"plate\.frame: missing; film\.mp4 is a video"):
        read_photographs(shot_of(tmp_path, VIDEO.format("1").partition("[sequence]")[0]))
    with pytest.warns(DoubtWarning, match=r"sequence\.rate is 25 and film\.mp4 has 24 frames a second"):
        frames_of(shot_of(tmp_path, VIDEO.format("1-6") + "rate = 25\n"))
    (tmp_path / "film.mp4").write_bytes(b"no film at all")
    with pytest.raises(UnreadableFile, match=r"film\.mp4: cannot be read as a video") as caught:
        frames_of(shot_of(tmp_path, VIDEO.format("1-6")))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        ("readout = 0.02\npose = { position = [0, 1, 1], look_at = [0, 0, 0] }", "readout is of a camera that moves"),
        ('file = "a.chan"\nreadout = 2.0', "camera.readout"),
        ('file = "a.chan"\n[[camera.keyframes]]\nframe = 1\nposition = [0, 0, 1]', "both file and keyframes"),
        ('file = "a.glb"\nfocal_length = 3.0', "file holds the focal length"),
    ],
)
def test_cameras_that_contradict_themselves_are_refused(tmp_path, camera, words):
    with pytest.raises(InvalidShot, match=words):
        shot_of(tmp_path, f'plate.photographs = "p.exr"\nlight.map = "l.exr"\n[camera]\n{camera}\n')


@pytest.mark.slow
def test_a_ball_inserted_in_a_film_covers_the_filmed_one(tmp_path):
    """From a video, through lens and rolling shutter; all that it leaves alone stays the video's."""
    move, frames = Matchmove(readout=0.02, lens=True), range(101, 105)
    path = move.write(tmp_path, frames, plates="film.mp4", sequence="offset = -100", samples=16)
    made = insert_frames(read_shot(path), tmp_path / "out")
    apart = []
    for frame in made.frames:
        matte = files.read_layers(frame.folder / "layers.exr")["matte"]
        apart.append(middle_of(matte) - middle_of(move.seen(frame.number)[1]))
        composite = files.read_photograph(frame.folder / "composite.png").pixels
        plate = read_video_frame(tmp_path / "film.mp4", frame.number - 100).pixels
        assert np.array_equal(composite[:40], plate[:40])
    assert np.sqrt(np.mean(np.sum(np.square(apart), axis=1))) < 0.1


@pytest.mark.slow
def test_the_grain_of_objects_moves_with_the_film_and_is_the_plates(tmp_path):
    move, frames = Matchmove(check=np.inf), range(101, 103)
    path = move.write(tmp_path, frames, noise=2.5, samples=256)
    made = insert_frames(read_shot(path), tmp_path / "out")
    inside = np.asarray(binary_erosion(move.seen(101)[1] * move.seen(102)[1] > 0.999), bool)
    pictures = [files.read_photograph(each.folder / "composite.png").pixels.astype(float) for each in made.frames]
    # Beside its four neighbours a pixel of independent noise has 5/4 of its variance, and shading nothing.
    grain = [(each - sum(np.roll(each, step, axis) for step in (-1, 1) for axis in (0, 1)) / 4)[inside]
             for each in pictures]  # fmt: skip
    for each in grain:
        assert np.std(each) / np.sqrt(1.25) == pytest.approx(2.5, rel=0.2)
    assert np.abs(np.corrcoef(grain[0].ravel(), grain[1].ravel())[0, 1]) < 0.15
    # The light is the same in both.
    balls = [picture[move.seen(n)[1] > 0.999].mean() for picture, n in zip(pictures, frames, strict=True)]
    assert np.abs(balls[1] - balls[0]) < 1


def test_cameras_that_colmap_found_go_by_the_numbers_of_the_plates(tmp_path):
    """Three views to the right of one another, half a unit apart; two metres to a unit; the fourth was not found."""
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_RADIAL 192 128 190 96 64 -0.1\n")
    (tmp_path / "points3D.txt").write_text("1 0 0 5 0 0 0 0.5\n")
    views = [f"{n} 1 0 0 0 {-0.5 * n} 0 0 1 plate_{n:03}.png\n\n" for n in (1, 2, 3, 5)]
    (tmp_path / "images.txt").write_text("".join(views))
    (tmp_path / "place.toml").write_text('[photogrammetry]\nmodel = "."\nmetres_per_unit = 2.0\n')
    for frame in range(1, 6):
        (tmp_path / f"plate_{frame:03}.png").write_bytes(b"")
    text = """
[plate]
photographs = "plate_001.png"
[camera]
file = "place.toml"
readout = 0.02
[light]
map = "plate_001.png"
[sequence]
frames = "{}"
plates = "plate_*.png"
"""
    shot = shot_of(tmp_path, text.format("1-2"))
    assert frames_of(shot) == [1, 2]
    camera = camera_fit(at_frame(shot, 2).camera, SIZE, tmp_path, None).camera
    np.testing.assert_allclose(camera.position, [2, 0, 0], atol=1e-9)
    np.testing.assert_allclose(-camera.rotation[:, 2], [0, 0, -1], atol=1e-9)
    assert camera.focal_length == pytest.approx(190) and camera.distortion is not None
    assert camera.distortion.k1 == pytest.approx(-0.1)
    # From frame to frame a metre: 0.48 of a frame's time between the first row and the last.
    assert camera.rolling is not None and camera.rolling.moves[0] == pytest.approx([0.48, 0, 0], abs=1e-6)
    with pytest.raises(UnreadableFile, match="no photograph has the number of frame 4; its camera was not found"):
        camera_fit(at_frame(shot_of(tmp_path, text.format("1-5")), 4).camera, SIZE, tmp_path, None)
    # Before anything is made, also where only the last rows of a frame or its shutter need what was not found.
    for frames, more in (("1-5", ""), ("1-3", ""), ("1-2", "shutter = [0, 0.9]\nrate = 12"), ("1,2,5", "")):
        asked = text.format(frames).replace("readout = 0.02", "readout = 0.1" if more else "readout = 0.02") + more
        with pytest.raises(InvalidShot, match=r"camera\.file: .*no photograph has the number of frame \d"):
            frames_of(shot_of(tmp_path, asked))
    with pytest.raises(InvalidShot, match=r"place\.toml has the frames 1 to 5, and the sequence asks for 0 to 3"):
        (tmp_path / "plate_000.png").write_bytes(b"")
        frames_of(shot_of(tmp_path, text.format("0-3")))


def test_a_shutter_that_reaches_beyond_the_track_is_refused_before_anything_is_made(tmp_path):
    shot = track(tmp_path, Matchmove(), "readout = 0.1")
    assert shot.sequence is not None
    # The lines go to 113: 112 + 0.5 + 0.05 s · 24 is within a frame of it, and 112 + 0.9 + 1.2 is not.
    for shutter, refused in (((0.0, 0.5), False), ((0.0, 0.9), True)):
        sequence = shot.sequence.model_copy(update={"shutter": shutter})
        asked = shot.model_copy(update={"sequence": sequence})
        if refused:
            with pytest.raises(InvalidShot, match=r"track\.chan: holds the frames 100 to 113, and frame 114\.1 was"):
                frames_of(asked)
        else:
            assert frames_of(asked) == list(PLATES)


@pytest.mark.parametrize("keep", ["camera", "lamp", "nothing"])
def test_under_maps_that_change_a_camera_of_a_file_and_lamps_with_keys_open_the_shutter(tmp_path, keep):
    text = """
plate.photographs = "plate_101.png"
[camera]
file = "track.chan"
[light]
maps = "light.exr"
{}
[sequence]
frames = "101-112"
shutter = [-0.25, 0.25]
{}
"""
    lamp = """[[light.added]]
direction = [0, 1, 0]
irradiance = [1, 1, 1]
size = 5
[[light.added.keyframes]]
frame = 101
direction = [0, 1, 0]
"""
    track(tmp_path, Matchmove(), "")
    plates = 'plates = "plate_*.png"' if keep == "camera" else ""
    shot = shot_of(tmp_path, text.format(lamp if keep == "lamp" else "", plates))
    opened = shutter_of(shot)
    assert (opened is None) == (keep == "nothing")
    assert opened is None or (opened.open, opened.close) == (-0.25, 0.25)


@pytest.mark.parametrize(("scale", "expected"), [(None, (1.2, 1.0, 0.7)), (2.0, (2.4, 2.0, 1.4))])
def test_scale_and_white_are_measured_once_for_all_plates(tmp_path, monkeypatch, scale, expected):
    """The measuring itself, which other tests cover, is taken as given: what counts is that it happens once."""
    shot = track(tmp_path, Matchmove(), "")
    shot = shot.model_copy(update={"light": shot.light.model_copy(update={"scale": scale})})
    asked = []

    def gains(first, calibrated, camera):
        asked.append(first.plate.photographs)
        return np.array([1.2, 1.0, 0.7]) * (first.light.scale or 1.0)

    monkeypatch.setattr(making, "calibrate", lambda *given: None)
    monkeypatch.setattr(making, "read_photographs", lambda first: None)
    monkeypatch.setattr(making, "find_camera", lambda *given: SimpleNamespace(camera=None))
    monkeypatch.setattr(making, "gains_on_one_scale", gains)
    steady = with_steady_light(shot, tmp_path / "out")
    assert steady.light.scale == pytest.approx(expected) and asked == [["plate_101.png"]]
    # A worker that is given it measures no more.
    assert with_steady_light(steady, tmp_path / "out") is steady and len(asked) == 1
