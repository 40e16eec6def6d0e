"""A film: frames that are kept, one exposure for all, and what is refused in one line."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from command_line import refused, reported
from relume.errors import InvalidScene
from relume.image.colour import decode_srgb
from relume.image.files import read_photograph, read_radiance
from relume.project.film.film_file import read_film

SCENE = """
[camera]
size = [24, 16]
position = [0, 1, 4]
target = [0, 0, 0]
[light]
colour = 0.5
keyframes = [{ frame = 1, exposure = 0 }, { frame = 3, exposure = -2 }]
[sequence]
frames = "1-3"
[materials.clay]
kind = "diffuse"
reflectance = 0.5
[[objects]]
sphere = { centre = [0, 0, 0], radius = 0.5 }
material = "clay"
"""
FILM = """
scene = "scene.toml"
[render]
samples = 4
denoise = false
[output]
folder = "made"
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A film of three frames."""
    pytest.importorskip("av")
    folder = tmp_path_factory.mktemp("film")
    (folder / "scene.toml").write_text(SCENE)
    (folder / "film.toml").write_text(FILM)
    result = rl.make_film(folder / "film.toml")
    assert (result.frames, result.kept, result.size) == (3, 0, (24, 16))
    assert result.movie == folder / "made/film.mp4" and result.sheet == folder / "made/sheet.png"
    return folder


@pytest.fixture
def film(made: Path, tmp_path: Path) -> Path:
    """The same for a test that changes it: its file."""
    shutil.copytree(made, tmp_path / "film")
    return tmp_path / "film/film.toml"


def test_a_film_has_its_frames_as_radiance_and_as_a_movie(made):
    import av

    with av.open(str(made / "made/film.mp4")) as movie:
        assert sum(1 for _ in movie.decode(video=0)) == 3
        assert movie.streams.video[0].average_rate == 24
    for number, light in ((1, 0.5), (2, 0.25), (3, 0.125)):
        radiance = read_radiance(made / f"made/frames/frame_{number:04d}.exr").radiance
        np.testing.assert_allclose(radiance[0, 0], light)
    # Three pictures of 24 × 16 on the sheet, and eight pixels between them.
    assert read_photograph(made / "made/sheet.png").size == (4 * 8 + 3 * 24, 2 * 8 + 16)


def test_all_frames_have_one_exposure(made):
    shown = [
        decode_srgb(read_photograph(made / f"made/developed/frame_{number:04d}.png").pixels[0, 0, 0] / 255)
        for number in (1, 2, 3)
    ]
    # The first frame's light is ½ of white, and the film does not meter the others anew.
    np.testing.assert_allclose(shown, [0.5, 0.25, 0.125], rtol=0.02)


def test_a_tone_operator_adapts_to_the_first_frame_alone(film):
    film.write_text(FILM + '[develop]\ntone = { kind = "exposure" }\n')
    assert rl.make_film(film).kept == 3
    shown = [
        decode_srgb(read_photograph(film.parent / f"made/developed/frame_{number:04d}.png").pixels[0, 0, 0] / 255)
        for number in (1, 2, 3)
    ]
    np.testing.assert_allclose(np.divide(shown, shown[0]), [1, 0.5, 0.25], rtol=0.03)


def test_a_film_that_is_there_is_not_made_again_and_is_developed_anew_without_rendering(film):
    folder = film.parent / "made"
    rl.make_film(film)  # what was made in another folder is developed and joined anew
    times = {path: path.stat().st_mtime_ns for path in folder.rglob("*.*") if path.suffix in (".exr", ".mp4")}
    assert rl.make_film(film).kept == 3
    assert all(path.stat().st_mtime_ns == before for path, before in times.items())
    # A lens that darkens the corners.
    film.write_text(FILM + '[develop]\nvignetting = { kind = "natural" }\n')
    assert rl.make_film(film).kept == 3
    assert (folder / "frames/frame_0001.exr").stat().st_mtime_ns == times[folder / "frames/frame_0001.exr"]
    assert (folder / "film.mp4").stat().st_mtime_ns != times[folder / "film.mp4"]
    corner, middle = read_photograph(folder / "developed/frame_0001.png").pixels[0, [0, 12], 0].astype(int)
    assert corner < middle - 8


def test_parts_of_a_film_are_rendered_and_the_rest_later(made, tmp_path):
    part = rl.make_film(made / "film.toml", tmp_path / "out", frames="2")
    assert (part.frames, part.movie, part.sheet) == (1, None, None)
    assert [path.name for path in (tmp_path / "out/frames").glob("*.exr")] == ["frame_0002.exr"]
    assert not (tmp_path / "out/developed").exists()
    whole = rl.make_film(made / "film.toml", tmp_path / "out")
    assert (whole.frames, whole.kept) == (3, 1)
    one, other = (read_radiance(folder / "frames/frame_0002.exr") for folder in (made / "made", tmp_path / "out"))
    np.testing.assert_array_equal(one.radiance, other.radiance)


def test_the_films_own_words_replace_the_scene_files(made):
    path = made / "changed.toml"
    sequence = '[sequence]\nframes = "2-3"\nrate = 12\nshutter = [0, 0.5]\n'
    path.write_text(FILM + sequence + '[develop]\npreset = "old-lens"\n')
    found = read_film(path, size=(12, 8))
    assert found.scene.sequence is not None
    table = found.scene.sequence.table
    assert (table.frames, table.rate, table.shutter) == ((2, 3), 12, (0, 0.5))
    assert found.scene.scene.light.radiance.max() == 0.25  # the first frame is the second
    assert (found.scene.camera.width, found.settings.samples) == (12, 4)
    assert found.preset.camera.glare is not None and not found.preset.has_tone


def test_the_example_is_a_film_of_ten_seconds():
    found = read_film(Path(__file__).parents[2] / "examples/films/natural_light/film.toml")
    assert found.scene.sequence is not None
    assert len(found.scene.sequence.table.frames) / found.scene.sequence.table.rate == 10
    assert found.scene.camera.aperture > 0 and found.scene.sequence.shutter is not None
    assert found.preset.camera.glare is not None and found.preset.camera.vignetting is not None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (FILM.replace("scene =", "scnee ="), "scnee: unknown key; did you mean scene?"),
        (FILM + 'movie = "film.avi"\n', "output.movie: is 'film.avi'; give a name that ends in .mp4"),
        (FILM + '[develop]\nglaer = { kind = "eye" }\n', "develop.glaer: unknown key; did you mean glare?"),
        (FILM + '[develop]\nglare = { kind = "nose" }\n', "develop.glare.kind: got 'nose'; expected one of"),
        (FILM + '[sequence]\nframes = "9-1"\n', "sequence.frames: '9-1' has no frames"),
        (FILM + "[sequence]\nshutter = [1, 0]\n", "sequence: shutter is [1.0, 0.0]; expected shares"),
        (FILM + "[sequence]\nframes = [-1]\n", "sequence.frames: 1 frames; give 1 to"),
        ('light = "none.exr"\n' + FILM, "light: "),
        (FILM.replace("scene =", "title ="), "scene: missing; the film file must have it"),
        ('scene = "none.toml"\n', "scene: "),
    ],
)
def test_a_fault_is_one_line_with_its_key(made, text, line):
    path = made / "fault.toml"
    path.write_text(text)
    with pytest.raises(InvalidScene) as caught:
        read_film(path)
    assert str(caught.value).startswith(f"{path}: ") and line in str(caught.value) and "\n" not in str(caught.value)


def test_a_scene_without_a_sequence_is_no_film(tmp_path):
    (tmp_path / "film.toml").write_text(FILM)
    (tmp_path / "scene.toml").write_text(SCENE.replace('[sequence]\nframes = "1-3"\n', "").replace("keyframes", "#"))
    with pytest.raises(InvalidScene, match="sequence: missing; a film needs"):
        read_film(tmp_path / "film.toml")


# The command


def test_the_command_makes_a_film_and_says_where_it_is(film, capsys):
    facts = reported(["film", str(film)], capsys)
    assert facts["written"] == str(film.parent / "made/film.mp4")
    assert (facts["frames"], facts["kept from before"], facts["seconds"]) == (3, 3, 0.125)
    said = reported(["film", str(film), "-o", str(film.parent / "other"), "--dry-run", "--size", "48x32"], capsys)
    assert said["would write"] == str(film.parent / "other/film.mp4") and said["size"] == "48×32"
    assert not (film.parent / "other").exists()


def test_frames_that_a_film_has_not_are_refused_in_one_line(film, capsys):
    assert "frame 7 is not in the [sequence]" in refused(["film", str(film), "--frames", "7"], capsys)
    assert "none.toml: no such file; check the path" in refused(["film", str(film.parent / "none.toml")], capsys)
