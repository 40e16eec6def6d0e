"""`relume model`: a place file begun, solved, written and exported, and what is refused."""

from __future__ import annotations

import numpy as np

import place_shoot
from command_line import printed, refused, reported
from relume.image import files
from relume.image.photograph import Photograph


def test_a_place_is_solved_written_and_exported(tmp_path, capsys):
    (tmp_path / "marks.toml").write_text(place_shoot.toml())
    out, mesh = tmp_path / "place.toml", tmp_path / "place.obj"
    found = reported(["model", tmp_path / "marks.toml", "-o", out, "--export", mesh], capsys)
    assert found["written"] == [str(out), str(mesh)]
    assert found["blocks"]["house"]["width"] == "8 m" and found["cameras"]["photo2"]["marks"] == 50
    assert "[found.cameras" in out.read_text() and mesh.read_text().count("\no ") == 4
    # What was found is in the report's lines, too.
    lines = printed(["model", out], capsys).out
    assert "roof" in lines and "± " in lines and out.read_text().count("[found]") == 1


def test_photographs_are_laid_on_the_place(tmp_path, capsys):
    (tmp_path / "marks.toml").write_text(place_shoot.toml(noise=0.0))
    maps, glb = place_shoot.radiance_maps(tmp_path, 120), tmp_path / "place.glb"
    command = ["model", tmp_path / "marks.toml", "--texel", 0.4, "--export", glb, "--textures", *maps]
    found = reported(command, capsys)
    assert found["written"] == [str(glb)] and glb.is_file()
    assert found["blocks"]["house"]["width"] == "8 m" and found["textures"]["roof"].startswith("4")
    assert found["filled"].endswith("% of the surface") and "lie" in found["seams"]
    assert found["brightness"]["photo3"].endswith(" of the middle one")
    line = refused(["model", tmp_path / "marks.toml", "--textures", *maps], capsys)
    assert "--textures go into --export place.glb" in line
    # No width is a width that was given; a file that is not there is none to try with.
    assert "--texel are theirs" in refused(["model", tmp_path / "marks.toml", "--texel", 0], capsys)
    assert "texel is 0.0" in refused([*command[:2], "--texel", 0, *command[4:]], capsys)
    line = refused(["model", tmp_path / "marks.toml", "--export", glb, "--textures", "none.exr", "--dry-run"], capsys)
    assert "none.exr" in line


def test_a_folder_of_photographs_begins_a_place_file(tmp_path, capsys):
    (tmp_path / "photographs").mkdir()
    (tmp_path / "photographs" / "README.md").write_text("no picture")
    for name in ("north side.png", "south.png"):
        files.write(tmp_path / "photographs" / name, Photograph(np.zeros((30, 40, 3), np.uint8)))
    out = tmp_path / "place.toml"
    noted = printed(["model", tmp_path / "photographs", "-o", out], capsys).err
    assert "mark their edges" in noted
    text = out.read_text()
    assert 'name = "north_side"\nfile = "photographs/north side.png"\nsize = [40, 30]' in text
    assert "# roof: back_bottom, right_bottom, front_bottom, left_bottom, ridge, front_left, front_right," in text
    assert max(map(len, text.splitlines())) <= 120
    # It is a place file, which lacks nothing but marks.
    assert "photograph 'north_side' has no marked edges" in refused(["model", out], capsys)
    assert "is there already" in refused(["model", tmp_path / "photographs", "-o", out], capsys)
    assert out.read_text() == text


def test_what_is_refused_leaves_nothing_written(tmp_path, capsys):
    (tmp_path / "marks.toml").write_text(place_shoot.toml(photo1={}))
    out = tmp_path / "place.toml"
    line = refused(["model", tmp_path / "marks.toml", "-o", out, "--export", tmp_path / "place.glb"], capsys)
    assert "photograph 'photo1' has no marked edges" in line
    assert "must end in .glb" in refused(["model", tmp_path / "marks.toml", "--export", tmp_path / "place.fbx"], capsys)
    assert "no such place file" in refused(["model", tmp_path / "nothing.toml"], capsys)
    assert "give -o place.toml" in refused(["model", tmp_path], capsys)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["marks.toml"]
