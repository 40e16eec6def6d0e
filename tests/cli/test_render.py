"""`relume render`: what it writes, which renderer it takes, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lights
import relume as rl
from command_line import printed, refused, reported
from relume.cli import main
from relume.errors import DoubtWarning
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.radiance import RadianceMap
from relume.renderers import PhotonMap
from relume.sphere.environment_files import as_radiance_map
from toml_files import FAR_CAMERA

SCENE = (
    FAR_CAMERA
    + """\
[light]
map = "light.exr"
[materials.chrome]
kind = "mirror"
[materials.clay]
kind = "diffuse"
reflectance = [0.5, 0.5, 0.5]
[[objects]]
sphere = { centre = [%s, 0, 0], radius = 1 }
material = "%s"
"""
)
LIT = (
    FAR_CAMERA
    + """\
[[lights]]
kind = "distant"
towards = [0, 0, 1]
irradiance = 3.14159265
%s
[materials.clay]
kind = "diffuse"
reflectance = [0.5, 0.5, 0.5]
[materials.blob]
kind = "whitted"
diffuse = 0.5
[[objects]]
sphere = { centre = [1, 0, 0], radius = 1 }
material = "%s"
"""
)
AMBIENT = '[[lights]]\nkind = "ambient"\nradiance = 0.1\n'
TRIANGLES = "v -1 0 0\nv 1 0 0\nv 0 0 1\nv 0 2 0\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 1 3 2\n"
OUTWARD = "v -1 0 0\nv 1 0 0\nv 0 0 1\nv 0 2 0\nf 4 2 1\nf 4 3 2\nf 4 1 3\nf 2 3 1\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "light.exr", as_radiance_map(lights.constant(16, 0.5)))
    (tmp_path / "clay.toml").write_text(SCENE % (0, "clay"))
    (tmp_path / "chrome.toml").write_text(SCENE % (0, "chrome"))
    (tmp_path / "aside.toml").write_text(SCENE % (1, "chrome"))
    (tmp_path / "body.obj").write_text(TRIANGLES)
    (tmp_path / "sunlit.toml").write_text(LIT % ("", "clay"))
    (tmp_path / "ambient.toml").write_text(LIT % (AMBIENT, "clay"))
    (tmp_path / "blob.toml").write_text(LIT % ("", "blob"))
    (tmp_path / "asking.toml").write_text(LIT % ("[whitted]\ndepth = 3", "clay"))
    (tmp_path / "moving.toml").write_text(LIT % ("", "clay") + "orbit = { centre = [0, 0, 0], turns = 1 }\n")
    return tmp_path


def command(folder: Path, scene: str, out: str, *options: str) -> list[str]:
    return ["render", str(folder / scene), "-o", str(folder / out), *options]


def test_an_exr_holds_radiance_matte_depth_and_normals(folder):
    assert main(command(folder, "clay.toml", "picture.exr", "--renderer", "prefiltered")) == 0
    layers = read_layers(folder / "picture.exr")
    assert set(layers) == {"radiance", "matte", "depth", "normal"}
    # Lambert of ½ in constant light of ½, before that light; sixteen rows of pixel middles hold it to 0.2 %.
    assert layers["radiance"][15, 20] == pytest.approx(0.25, rel=2e-3)
    assert layers["radiance"][0, 0] == pytest.approx(0.5, rel=1e-5)
    assert (layers["matte"][15, 20], layers["matte"][0, 0]) == (1, 0)
    assert layers["depth"][15, 20] == pytest.approx(5, abs=0.01)
    assert layers["normal"][15, 20] == pytest.approx([0, 0, 1], abs=0.05)


def test_a_mirror_needs_maps_and_gets_them(folder, capsys):
    assert "renderer  prefiltered" in printed(command(folder, "chrome.toml", "picture.hdr"), capsys).out
    np.testing.assert_allclose(read_radiance(folder / "picture.hdr").radiance, 0.5, rtol=0.01)


def test_what_any_renderer_shades_is_left_to_light_transport(folder, capsys):
    assert "renderer     mitsuba" in printed(command(folder, "clay.toml", "picture.exr", "--dry-run"), capsys).out
    assert not (folder / "picture.exr").exists()


def test_a_picture_is_metered_by_the_mean_of_the_light(folder):
    assert main(command(folder, "chrome.toml", "picture.png", "--exposure", "1")) == 0
    # The mean is ½ of white, a stop more is white.
    assert read_photograph(folder / "picture.png").pixels.min() >= 254


def test_objects_over_a_plate_leave_the_rest_of_it_as_it_is(folder):
    plate = np.random.default_rng(1).random((30, 40, 3), dtype=np.float32)
    write(folder / "plate.exr", RadianceMap(plate))
    (folder / "clay.toml").write_text(
        SCENE % (0, "clay") + '[[local]]\nshape = "plane"\nreflectance = [1, 1, 1]\nheight = -1\n'
    )
    assert main(command(folder, "clay.toml", "picture.exr", "--plate", str(folder / "plate.exr"), "-q")) == 0
    layers = read_layers(folder / "picture.exr")
    outside = layers["matte"] == 0
    assert 0.4 < outside.mean() < 0.95
    np.testing.assert_array_equal(layers["radiance"][outside], plate[outside])
    # The real plane is in the plate already: no pixel is brighter than object and plate together can be.
    assert layers["radiance"].max() <= plate.max() + 1e-6


def test_a_turntable_turns_objects_where_they_stand(folder):
    assert main(command(folder, "aside.toml", "turn", "--frames", "3")) == 0
    frames = [read_photograph(folder / f"turn/frame_{i:04d}.png").pixels for i in (1, 2, 3)]
    assert np.array_equal(frames[0], frames[1])
    assert np.array_equal(frames[0], frames[2])
    assert len(list((folder / "turn").glob("*.*"))) == 3 + 1  # and the record of what made them


def test_frames_of_two_movies_are_not_mixed(folder, capsys):
    assert main(command(folder, "chrome.toml", "turn", "--frames", "3")) == 0
    line = refused(command(folder, "chrome.toml", "turn", "--frames", "2"), capsys)
    assert "holds frames of another movie, from frame_0003.png on" in line


def test_a_movie_has_its_frames(folder):
    av = pytest.importorskip("av")
    assert main(command(folder, "chrome.toml", "turn.mp4", "--frames", "4", "--motion", "orbit")) == 0
    with av.open(str(folder / "turn.mp4")) as movie:
        assert sum(1 for _ in movie.decode(video=0)) == 4


def test_a_mesh_is_framed_whole_in_any_size(folder):
    for size in ("40x30", "64x20", "20x64"):
        options = ("--light", str(folder / "light.exr"), "--renderer", "prefiltered", "--size", size)
        assert main(command(folder, "body.obj", "picture.exr", *options)) == 0
        matte = read_layers(folder / "picture.exr")["matte"]
        assert matte.any()
        assert not (matte[0].any() or matte[-1].any() or matte[:, 0].any() or matte[:, -1].any())


# Whitted's trees


def chosen(folder: Path, capsys, scene: str, *options: str) -> str:
    """The renderer that a dry run says."""
    out = "frames" if "--frames" in options else "a.png"
    return reported(command(folder, scene, out, "--dry-run", *options), capsys)["renderer"]


@pytest.mark.parametrize(
    ("scene", "options", "renderer"),
    [
        ("clay.toml", [], "mitsuba"),
        ("chrome.toml", [], "prefiltered"),
        ("sunlit.toml", [], "mitsuba"),
        ("ambient.toml", [], "whitted"),
        ("blob.toml", [], "whitted"),
        ("asking.toml", [], "whitted"),
        ("moving.toml", [], "mitsuba"),
        ("moving.toml", ["--frames", "2"], "whitted"),
        ("clay.toml", ["--frames", "2"], "prefiltered"),
        ("sunlit.toml", ["--frames", "2"], "whitted"),
        ("clay.toml", ["--depth", "2"], "mitsuba"),
        ("clay.toml", ["--depth", "2", "--rays", "3"], "whitted"),
        ("clay.toml", ["--frames", "2", "--samples", "2"], "mitsuba"),
        ("moving.toml", ["--frames", "2", "--renderer", "mitsuba"], "mitsuba"),
        ("chrome.toml", ["--seed", "2"], "whitted"),
        ("clay.toml", ["--renderer", "mapped"], "prefiltered"),  # its name before
        ("clay.toml", ["--seed", "2"], "mitsuba"),
        ("asking.toml", ["--renderer", "mitsuba"], "mitsuba"),
        ("clay.toml", ["--region", "0,0,9,9", "--frames", "2"], "whitted"),
    ],
)
def test_the_renderer_is_what_the_options_allow_and_the_scene_asks_for(folder, capsys, scene, options, renderer):
    assert chosen(folder, capsys, scene, *options) == renderer


def test_a_picture_of_darkness_says_why(folder, capsys):
    for light, reason in (
        ('[[lights]]\nkind = "point"\nposition = [0, 0, 0]\nintensity = [1, 1, 1]', "is a lamp inside a shape"),
        ("[light]\ncolour = 1\n[whitted]\nconstellation = 0", "lights nothing while constellation is 0"),
    ):
        (folder / "dark.toml").write_text(
            f"""{light}
[camera]
position = [0, 0, 3]
target = [0, 0, 0]
[materials.clay]
kind = "diffuse"
reflectance = 0.5
[[objects]]
sphere = {{ centre = [0, 0, 0], radius = 0.5 }}
material = "clay"
"""
        )
        said = printed(command(folder, "dark.toml", "dark.png", "--renderer", "whitted", "--size", "16x12"), capsys).err
        assert "no light reaches the surfaces that are seen, so they are black" in said
        assert reason in said


def test_an_exr_by_trees_holds_the_number_of_rays_too(folder):
    assert main(command(folder, "blob.toml", "picture.exr", "--seed", "3")) == 0
    layers = read_layers(folder / "picture.exr")
    assert set(layers) == {"radiance", "matte", "depth", "normal", "rays"}
    # Lambert of ½ that faces a light of strength 1; behind the ball is nothing.
    assert layers["radiance"][15, 31] == pytest.approx(0.5, rel=0.01)
    assert layers["radiance"][15, 5].tolist() == [0, 0, 0]
    assert layers["rays"].dtype == np.float32
    assert layers["rays"].min() >= 0 and layers["rays"].max() > 9 and np.all(layers["rays"] % 1 == 0)


def test_a_region_is_that_part_of_the_picture(folder):
    assert main(command(folder, "blob.toml", "whole.exr")) == 0
    assert main(command(folder, "blob.toml", "part.exr", "--region", "20,5,40,25")) == 0
    whole, part = (read_layers(folder / name)["radiance"] for name in ("whole.exr", "part.exr"))
    assert part.shape == (20, 20, 3)
    np.testing.assert_array_equal(part, whole[5:25, 20:40])


def test_the_command_line_has_the_last_word_on_the_files_settings(folder):
    text = (folder / "asking.toml").read_text()
    (folder / "asking.toml").write_text(text.replace("depth = 3", "antialiasing = false"))
    pictures = {}
    for name, options in {"plain": [], "fine": ["--subdivisions", "4"], "coarse": ["--tolerance", "0.5"]}.items():
        assert main(command(folder, "asking.toml", f"{name}.exr", *options)) == 0
        pictures[name] = read_layers(folder / f"{name}.exr")["rays"].mean()
    assert pictures["plain"] < pictures["coarse"] < pictures["fine"]
    assert main(command(folder, "clay.toml", "none.exr", "--renderer", "whitted", "--depth", "0", "--rays", "4")) == 2


def test_a_mesh_and_a_map_are_rendered_by_trees(folder):
    (folder / "pyramid.obj").write_text(OUTWARD)
    options = ("--light", str(folder / "light.exr"), "--renderer", "whitted", "--size", "32x24")
    assert main(command(folder, "pyramid.obj", "picture.exr", *options)) == 0
    layers = read_layers(folder / "picture.exr")
    assert layers["matte"].max() == 1
    # Under the same light from everywhere grey shows its reflectance's part of it, less what it keeps from itself.
    assert layers["radiance"][layers["matte"] == 1].mean() == pytest.approx(0.25, rel=0.15)


def test_orbits_move_while_frames_run_and_the_motion_is_the_orbits_alone(folder):
    assert main(command(folder, "moving.toml", "frames", "--frames", "4", "--exposure", "1")) == 0
    frames = [read_photograph(folder / f"frames/frame_{i:04d}.png").pixels[..., 0] for i in (1, 2, 3, 4)]
    across = [np.average(np.arange(40), weights=frame.sum(axis=0) + 1e-9) for frame in frames]
    # To the right, behind, to the left, and before the middle.
    assert across[0] > 25 and across[2] < 14
    assert across[1] == pytest.approx(19.5, abs=0.5) and across[3] == pytest.approx(19.5, abs=0.5)
    assert (frames[1] > 0).sum() < (frames[0] > 0).sum() < (frames[3] > 0).sum()


def test_a_turntable_and_an_orbit_of_the_camera_by_trees(folder):
    assert main(command(folder, "sunlit.toml", "turn", "--frames", "2", "-q")) == 0
    # The ball stands at the middle of all objects, so that it turns where it is.
    first, second = (read_photograph(folder / f"turn/frame_{i:04d}.png").pixels for i in (1, 2))
    np.testing.assert_array_equal(first, second)
    assert main(command(folder, "sunlit.toml", "round", "--frames", "2", "--motion", "orbit", "-q")) == 0
    first, second = (read_photograph(folder / f"round/frame_{i:04d}.png").pixels for i in (1, 2))
    # From behind, the light is behind the ball.
    assert first.max() > 180 and second.max() < 20


def test_checks_that_stay_while_their_object_moves_are_reported(folder, capsys):
    text = (folder / "blob.toml").read_text().replace("diffuse = 0.5", "diffuse = { checks = [1, 0] }")
    (folder / "blob.toml").write_text(text)
    turning = printed(command(folder, "blob.toml", "turn", "--frames", "1"), capsys).err
    assert "note: checks and waves lie in space: objects.0 will move through them" in turning
    orbiting = command(folder, "blob.toml", "round", "--frames", "1", "--motion", "orbit")
    assert "lie in space" not in printed(orbiting, capsys).err


def test_a_picture_is_metered_by_the_scenes_own_lights(folder):
    assert main(command(folder, "blob.toml", "picture.png")) == 0
    # Of one light of strength 1 a surface of ½ shows ½, which sRGB writes as 188.
    assert read_photograph(folder / "picture.png").pixels[15, 31].tolist() == pytest.approx([188, 188, 188], abs=2)


@pytest.mark.parametrize(
    ("scene", "out", "options", "line"),
    [
        ("body.obj", "a.png", [], "a mesh has no light"),
        ("light.exr", "a.png", [], "neither a scene file nor a mesh"),
        ("none.toml", "a.png", [], "no such file"),
        ("clay.toml", "a.mp4", [], "a movie needs --frames N"),
        ("clay.toml", "a.tif", [], "must end in"),
        ("clay.toml", "a.png", ["--frames", "2"], "with --frames give a folder"),
        ("clay.toml", "turn", ["--frames", "0"], "--frames"),
        ("clay.toml", "a.png", ["--degrees", "90"], "degrees is about a motion; give --frames N too"),
        ("clay.toml", "a.png", ["--size", "0x0"], "0x0"),
        ("clay.toml", "a.png", ["--size", "65537x9"], "65537×9 pixels; give 1 to 65536"),
        ("clay.toml", "a.png", ["--size", "big"], '"big" is not of the form WIDTHxHEIGHT'),
        ("clay.toml", "a.png", ["--renderer", "prefiltered", "--samples", "9"], "samples is for the renderer mitsuba"),
        ("clay.toml", "a.png", ["--renderer", "mitsuba", "--filter", "mip"], "filter is for the renderer prefiltered"),
        ("chrome.toml", "a.png", ["--renderer", "mitsuba"], "cannot shade the reflection maps of 'chrome'"),
        ("blob.toml", "a.png", ["--renderer", "mitsuba"], "Mitsuba cannot shade the whitted material 'blob'"),
        ("blob.toml", "a.png", ["--samples", "9"], "Mitsuba cannot shade the whitted material 'blob'"),
        ("ambient.toml", "a.png", ["--renderer", "mitsuba"], "Mitsuba has no ambient light"),
        ("sunlit.toml", "a.png", ["--renderer", "prefiltered"], "reflection maps hold light from infinity alone"),
        ("blob.toml", "a.png", ["--filter", "mip"], "reflection maps hold light from infinity alone"),
        (
            "clay.toml",
            "a.png",
            ["--renderer", "prefiltered", "--depth", "2"],
            "depth is for the renderer mitsuba or whitted,",
        ),
        ("clay.toml", "a.png", ["--filter", "mip", "--samples", "2"], "samples is for the renderer mitsuba"),
        ("clay.toml", "a.png", ["--region", "0,0,9,9", "--filter", "mip"], "region is for the renderer whitted"),
        ("clay.toml", "a.png", ["--renderer", "whitted", "--noise", "0.1"], "noise is for the renderer mitsuba, but"),
        ("chrome.toml", "a.png", ["--denoise"], "cannot shade the reflection maps of 'chrome'"),
        ("clay.toml", "a.exr", ["--environment", "0,2,0", "--denoise"], "denoise is for pictures: the six faces"),
        ("clay.toml", "turn", ["--frames", "1-3"], "without a [sequence] in the scene file it is the number of"),
        ("clay.toml", "a.png", ["--region", "0,0,9"], '"0,0,9" is not of the form LEFT,TOP,RIGHT,BOTTOM'),
        ("clay.toml", "a.png", ["--region", "0,0,41,9"], "region 0,0,41,9 is not a part of a picture of 40×30"),
        ("clay.toml", "a.png", ["--region", "9,0,9,9"], "region 9,0,9,9 is not a part of a picture of 40×30"),
        (
            "clay.toml",
            "a.png",
            ["--renderer", "whitted", "--depth", "0"],
            "depth is 0; expected a whole number from 1 to 1000",
        ),
        ("clay.toml", "a.png", ["--rays", "0"], "rays is 0; expected a whole number from 1 to 65536"),
        ("clay.toml", "a.png", ["--subdivisions", "9"], "subdivisions 9"),
        (
            "moving.toml",
            "turn",
            ["--renderer", "prefiltered", "--frames", "2"],
            "orbits need the renderer whitted or mitsuba",
        ),
        ("moving.toml", "turn", ["--frames", "2", "--degrees", "90"], "degrees say how far a motion goes"),
        ("asking.toml", "a.png", ["--samples", "2"], "the scene file's [whitted] table needs the renderer whitted"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(folder, capsys, scene, out, options, line):
    assert line in refused(command(folder, scene, out, *options), capsys)
    assert not (folder / out).exists()


def test_a_whitted_material_under_a_map_is_refused_by_maps_and_a_map_of_unknown_kind_by_all(folder, capsys):
    (folder / "blob.toml").write_text(SCENE.replace("chrome", "blob").replace("mirror", "whitted") % (0, "blob"))
    line = refused(command(folder, "blob.toml", "a.png", "--renderer", "prefiltered"), capsys)
    assert "reflection maps cannot shade the whitted material 'blob'" in line
    write(folder / "square.exr", RadianceMap(np.ones((4, 4, 3), np.float32)))
    line = refused(command(folder, "blob.toml", "a.png", "--light", str(folder / "square.exr")), capsys)
    assert "square.exr: a map of 4×4 pixels does not say its mapping" in line


def test_a_plate_of_another_size_is_refused_with_the_size_to_give(folder, capsys):
    write(folder / "plate.exr", RadianceMap(np.ones((10, 20, 3), np.float32)))
    line = refused(command(folder, "chrome.toml", "a.png", "--plate", str(folder / "plate.exr")), capsys)
    assert "give the picture the size 20x10" in line


def test_a_photon_map_is_named_and_takes_a_pass_for_each_sample(tmp_path, capsys):
    box = Path(__file__).parents[2] / "examples" / "cornell_box" / "cornell_box.toml"
    out = tmp_path / "box.exr"
    command = ["render", str(box), "--renderer", "photon-map", "--size", "12x12", "-o", str(out)]
    said = printed([*command, "--samples", "2", "--seed", "4", "--threads", "1"], capsys)
    assert "does not show the gloss of the lamp 'lamp'" in said.err and "photon-map" in said.out
    read = rl.read_scene(box)
    with pytest.warns(DoubtWarning, match="gloss of the lamp"):
        render = PhotonMap(passes=2).render(read.scene, read.camera.resized(12, 12), seed=4)
    np.testing.assert_array_equal(read_layers(out)["radiance"], render.radiance)
    assert "depth is for the renderer mitsuba" in refused([*command, "--depth", "3"], capsys)


def test_a_material_is_plotted_without_a_scene_and_by_its_name_in_one(folder, capsys):
    plotted = reported(["render", "--brdf", "gold", "--samples", "2", "-o", folder / "gold.png"], capsys)
    assert plotted["material"] == "gold" and read_photograph(folder / "gold.png").pixels.shape[1] == 1300
    printed(command(folder, "clay.toml", "clay.png", "--brdf", "clay", "--dry-run"), capsys)
    assert not (folder / "clay.png").exists()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--brdf", "lead", "-o", "a.png"], "no preset 'lead'"),
        (["--brdf", "gold", "-o", "a.exr"], "must end in .png or .svg"),
        (["--brdf", "gold", "-o", "a.png", "--frames", "3"], "--brdf plots one material, and --frames"),
        (["--brdf", "gold", "-o", "a.png", "--noise", "0.1"], "--brdf plots one material, and --noise"),
        (["--brdf", "gold", "-o", "a.png", "--renderer", "whitted"], "--brdf plots one material, and --renderer"),
        (["-o", "a.png"], "no scene is given"),
    ],
)
def test_a_plot_that_cannot_be_is_refused_in_one_line(capsys, arguments, line):
    assert line in refused(["render", *arguments], capsys)
