"""The tree of rays behind a pixel, asked of the server and drawn in the page: it adds up to what the picture has."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from browsing import Page, opened
from relume.studio.ray_trees import SceneTrees
from serving import Server, serving

pytest.importorskip("uvicorn", reason="the extra studio is not installed")

SCENE = """
[camera]
position = [0, 0.5, 4]
target = [0, 0, 0]
field_of_view = 40
size = [48, 32]

[light]
colour = [0.2, 0.3, 0.5]

[[lights]]
kind = "point"
position = [3, 5, 4]
intensity = [2, 2, 2]
falloff = "none"

[whitted]
antialiasing = false
constellation = 0

[materials.glass]
kind = "whitted"
diffuse = [0.02, 0.02, 0.02]
specular = 0.1
transmission = 0.8
ior = 1.5

[[objects]]
sphere = { centre = [0, 0, 0], radius = 0.8 }
material = "glass"
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("trees")
    (folder / "scene.toml").write_text(SCENE, "utf-8")
    rl.render_scene(rl.read_scene(folder / "scene.toml"), folder / "picture.exr")
    return [folder / "picture.exr", folder / "scene.toml"]


def test_a_tree_adds_up_to_the_pixel(files: list[Path]):
    trees, picture = SceneTrees(files[1]), rl.files.read_layers(files[0])["radiance"]
    for x, y in ((24, 16), (20, 12), (2, 2)):
        tree = trees.of(x, y)
        sent = np.array([node["sent"] for node in tree["nodes"]]).sum(0) + tree["left_out"]
        np.testing.assert_allclose(sent, picture[y, x], rtol=2e-6)
        assert tree["nodes"][0]["kind"] == "eye" and tree["nodes"][0]["intensity"] == pytest.approx(tree["sum"])
        assert all(0 <= node["parent"] < place for place, node in enumerate(tree["nodes"]) if place)
    ball = trees.of(24, 16)
    assert {node["kind"] for node in ball["nodes"]} == {"eye", "S", "T", "L"}
    assert ball["nodes"][0]["shape"] == "objects.0"
    assert len(trees.of(2, 2)["nodes"]) == 1 and trees.of(2, 2)["nodes"][0]["shape"] is None
    with pytest.raises(ValueError, match=r"pixel 48,0 lies outside the picture of 48×32 pixels; give 0,0 to 47,31"):
        trees.of(48, 0)


def test_a_tree_of_many_rays_keeps_the_strong_ones_and_the_sum(files: list[Path], monkeypatch: pytest.MonkeyPatch):
    whole = SceneTrees(files[1]).of(24, 16)
    monkeypatch.setattr("relume.studio.ray_trees.MOST", 5)
    few = SceneTrees(files[1]).of(24, 16)
    assert len(few["nodes"]) <= 5 < whole["rays"] == few["rays"] and few["sum"] == whole["sum"]
    sent = np.array([node["sent"] for node in few["nodes"]]).sum(0) + few["left_out"]
    np.testing.assert_allclose(sent, few["sum"], rtol=1e-9)


@pytest.fixture(scope="module")
def server(files: list[Path]) -> Iterator[Server]:
    with serving(files) as running:
        yield running


def test_a_click_draws_the_tree(browser: Any, server: Server, files: list[Path]):
    picture = rl.files.read_layers(files[0])["radiance"]
    with opened(browser, server.address, Page) as page:
        tab = page.tab
        tab.mouse.click(*page.point_at(24.5, 16.5))
        page.until(lambda: "add up to" in page.text("#tree"), "the tree")
        said = page.text("#tree")
        assert "pixel 24, 16" in said and "objects.0" in said and "sky" in said and "light 1" in said
        drawn = [node["intensity"] for node in SceneTrees(files[1]).of(24, 16)["nodes"]]
        assert tab.locator("#tree li").count() == len(drawn)
        sums = page.text("#tree .sums")
        value = f"{float(f'{picture[16, 24, 0]:.4g}'):g}"
        assert sums.count(value) == 2 and "mean of several" not in sums  # what rays add up to, and what the picture has
        tab.mouse.move(*page.point_at(2.5, 2.5))
        page.until(lambda: "2, 2" in page.text("#value"), "the pixel")
        page.press("t")
        page.until(lambda: "pixel 2, 2: 1 ray" in page.text("#tree"), "the tree of the sky")


def test_one_scene_file_at_most(files: list[Path]):
    with pytest.raises(ValueError, match="a second scene file; the trees of rays are those of one"):
        rl.view([files[0], files[1], files[1]], open_browser=False)
