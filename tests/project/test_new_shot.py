"""The shortest shot file as it is written: what it holds, what it guesses, and that it replaces nothing unasked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidShot, NotABracket, OutputNotWritten, UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import Shot, read_shot

OBJECTS = Path(__file__).parents[2] / "examples/room/objects"
CUBE, MONKEY = OBJECTS / "cube_gold.glb", OBJECTS / "suzanne_plastic.glb"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Photographs of nothing: only their names matter here."""
    for name in ("plate.jpg", "ball [1]/a.jpg", "ball [1]/b.jpg", "side/c.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        files.write(tmp_path / name, Photograph(np.full((8, 8, 3), 99, np.uint8)))
    return tmp_path


def new(place: Path, path: Path | None, *objects: Path, **more: object) -> Shot:
    balls = [place / "ball [1]/a.jpg", place / "ball [1]/b.jpg", place / "side"]
    return Shot.new(path, plate=[place / "plate.jpg"], balls=balls, objects=objects or [CUBE], radius=0.06, **more)  # pyright: ignore


def test_what_is_written_is_read_and_names_every_file(place: Path) -> None:
    shot = new(place, place / "out" / "shot.toml")
    assert shot == read_shot(place / "out" / "shot.toml") and shot.light.ball is not None
    assert shot.light.ball.radius == 0.06 and shot.camera.of_ball is not None
    # Every folder is a view; brackets in names are no pattern.
    views = [[path.name for path in shot.files(ball.photographs)] for ball in shot.light.balls or []]
    assert views == [["c.jpg"], ["a.jpg", "b.jpg"]] or views == [["a.jpg", "b.jpg"], ["c.jpg"]]
    assert views[0] == ["a.jpg", "b.jpg"]
    assert [path.resolve() for path in shot.files(shot.plate.photographs)] == [place / "plate.jpg"]
    lines = (place / "out" / "shot.toml").read_text().splitlines()
    assert sum(bool(line.strip()) and not line.startswith("#") for line in lines) == 9
    assert shot.render.denoise and shot.render.samples == 64


def test_nothing_is_written_without_a_path(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    shot = new(place, None, foot=(3.0, 4.0), rim=(5.0, 6.0, 7.5))
    assert shot.camera.ball is not None
    assert (shot.camera.ball.foot, shot.camera.ball.rim) == ((3, 4), (5, 6, 7.5))
    assert not (place / "shot.toml").exists() and shot.files(shot.plate.photographs)[0].is_file()


def test_another_file_is_not_replaced_unasked(place: Path) -> None:
    path = place / "shot.toml"
    new(place, path)
    kept = path.stat().st_mtime_ns
    new(place, path)  # the same again, as when a command is repeated
    assert path.stat().st_mtime_ns == kept
    path.write_text(path.read_text() + "# mine\n")
    with pytest.raises(OutputNotWritten, match=r"shot\.toml is there and says something else; .*or force .--force. to"):
        new(place, path)
    assert path.read_text().endswith("# mine\n")
    new(place, path, force=True)
    assert not path.read_text().endswith("# mine\n")


def test_objects_stand_side_by_side_and_those_of_no_table_get_a_size(place: Path) -> None:
    shot = new(place, place / "shot.toml", CUBE, MONKEY, CUBE)
    left, middle, right = placed_meshes(shot)
    assert left.vertices[:, 0].max() < middle.vertices[:, 0].min() < right.vertices[:, 0].min()
    assert left.vertices[:, 0].min() == pytest.approx(-right.vertices[:, 0].max(), abs=2e-3)
    assert all(mesh.vertices[:, 1].min() == 0 for mesh in (left, middle, right))
    # A cube of two units, in what its file calls metres.
    corners = [f"v {x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    (place / "cube.obj").write_text("\n".join([*corners, "f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7"]) + "\n")
    with pytest.warns(UserWarning, match=r"cube\.obj: its longest side is 2 m in the file.*0\.24 m are taken"):
        (mesh,) = placed_meshes(new(place, None, place / "cube.obj"))
    assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(4 * 0.06, rel=1e-5)
    assert (
        Shot.new(None, plate=[place / "plate.jpg"], balls=[place / "side"], objects=[CUBE], radius=0.06).objects[0].size
        is None
    )


def test_a_radius_in_centimetres_is_doubted(place: Path) -> None:
    with pytest.warns(UserWarning, match=r"the ball's radius is 5 m, more than a metre across.*5 cm are 0\.05"):
        Shot.new(None, plate=[place / "plate.jpg"], balls=[place / "side"], objects=[CUBE], radius=5.0)


def test_a_radius_that_is_guessed_is_said(place: Path) -> None:
    with pytest.warns(UserWarning, match=r"radius was not given, and 0\.05 m are taken"):
        shot = Shot.new(place / "s.toml", plate=[place / "plate.jpg"], balls=[place / "side"], objects=[CUBE])
    assert shot.light.ball is not None and shot.light.ball.radius == 0.05
    assert "a guess" in (place / "s.toml").read_text()


def test_what_is_not_there_is_refused(place: Path) -> None:
    with pytest.raises(UnreadableFile, match=r"nobody\.glb"):
        new(place, place / "shot.toml", place / "nobody.glb")
    with pytest.raises(ValueError, match=r"no plate was given.*`relume render` shows"):
        Shot.new(None, plate=[], balls=[place / "side"], objects=[CUBE])
    with pytest.raises(ValueError, match="radius is -1"):
        Shot.new(None, plate=[place / "plate.jpg"], balls=[place / "side"], objects=[CUBE], radius=-1.0)
    assert not (place / "shot.toml").exists()


def test_an_object_whose_name_looks_like_a_pattern_is_found(place: Path) -> None:
    named = place / "cube [2].glb"
    named.write_bytes(CUBE.read_bytes())
    shot = new(place, place / "shot.toml", named)
    assert shot.objects[0].mesh == "cube [2].glb" and len(placed_meshes(shot)) == 1


def test_what_is_no_shot_is_not_written(place: Path) -> None:
    with pytest.raises(InvalidShot, match="rim"):
        new(place, place / "out" / "shot.toml", rim=(5.0, 6.0, -7.5))
    assert not (place / "out").exists()


def test_a_folder_as_plate_is_said_to_be_one(place: Path) -> None:
    with pytest.raises(UnreadableFile, match=r"side: a folder; give the files in it, like .*side/\*"):
        Shot.new(None, plate=[place / "side"], balls=[place / "side"], objects=[CUBE], radius=0.06)


def test_a_finished_map_is_the_light_and_a_rim_or_one_photograph_gives_the_camera(place: Path) -> None:
    files.write(place / "map [a].hdr", RadianceMap(np.ones((8, 16, 3), np.float32)))
    ask = {"plate": [place / "plate.jpg"], "objects": [CUBE], "light": place / "map [a].hdr", "radius": 0.1}
    shot = Shot.new(place / "s.toml", **ask, rim=(5.0, 6.0, 1.5), surface_reflectance=0.4)  # pyright: ignore
    assert shot == read_shot(place / "s.toml") and shot.light.map == "map [a].hdr" and shot.light.balls is None
    assert shot.camera.ball is not None and (shot.camera.ball.radius, shot.camera.ball.rim) == (0.1, (5, 6, 1.5))
    assert shot.light.surface_reflectance == 0.4 and shot.surfaces()[0].size == pytest.approx((2.4, 2.4))
    # Without a rim: the place is guessed, and said to be.
    with pytest.warns(UserWarning, match=r"no ball says where the objects shall stand; x,y,radius 4,5,0 .*--rim"):
        shot = Shot.new(None, **ask)  # pyright: ignore
    assert shot.camera.ball is not None and shot.camera.ball.rim == pytest.approx((4, 4.96, 0.48))
    # One photograph of the ball gives the camera alone.
    shot = Shot.new(None, **ask, balls=[place / "ball [1]/a.jpg"])  # pyright: ignore
    assert shot.camera.ball is not None and Path(shot.camera.ball.photograph or "").name == "a.jpg"
    with pytest.raises(ValueError, match=r"^2 photographs of the ball beside a finished map.*give one"):
        Shot.new(None, **ask, balls=[place / "ball [1]/a.jpg", place / "ball [1]/b.jpg"])  # pyright: ignore
    with pytest.raises(ValueError, match=r"times are of a ball's bracket, and the light is a finished map"):
        Shot.new(None, **ask, times=[1.0])  # pyright: ignore


def test_times_are_of_the_ball_or_of_plate_and_ball_or_in_the_names(place: Path) -> None:
    def times(shot: Shot) -> list[object]:
        return [shot.plate.times, *(ball.times for ball in shot.light.balls or ())]

    assert times(new(place, None)) == [None, None, None]
    assert times(new(place, place / "s.toml", times=[0.1, 0.2, 0.4])) == [None, [0.1, 0.2], [0.4]]
    assert times(read_shot(place / "s.toml")) == [None, [0.1, 0.2], [0.4]]
    assert times(new(place, None, times=[1 / 3, 0.1, 0.2, 0.4])) == [[1 / 3], [0.1, 0.2], [0.4]]
    with pytest.raises(
        NotABracket,
        match=r"^2 times were given for 3 photographs of the ball and 1 of the plate; .*: ball \[1\]/a\.jpg, ball",
    ):
        new(place, None, times=[0.1, 0.2])
    with pytest.raises(ValueError, match="choose one of the two"):
        new(place, None, times=[0.1, 0.2, 0.4], times_from_names=True)
    with pytest.raises(NotABracket, match=r"a\.jpg: the names of these photographs give no times"):
        new(place, None, times_from_names=True)
    for name in ("ball [1]/a.jpg", "ball [1]/b.jpg"):
        (place / name).rename(place / f"ball [1]/cp_t{20 if 'a.' in name else 5}.jpg")
    named = Shot.new(
        None, plate=[place / "plate.jpg"], balls=sorted((place / "ball [1]").iterdir()), objects=[CUBE], radius=0.06,
        times_from_names=True,
    )  # fmt: skip
    assert times(named) == [None, [1 / 20, 1 / 5]]
    # A plate whose name holds a time has that too: it was taken for 1 s, 4.3 stops off.
    (place / "plate.jpg").rename(place / "cp_t80.jpg")
    both = Shot.new(
        None, plate=[place / "cp_t80.jpg"], balls=sorted((place / "ball [1]").iterdir()), objects=[CUBE], radius=0.06,
        times_from_names=True,
    )  # fmt: skip
    assert times(both) == [[1 / 80], [1 / 20, 1 / 5]]
