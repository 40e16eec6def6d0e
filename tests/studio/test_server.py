"""`relume view`'s server from outside: who is let in, and that every number it hands out is the file's own."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from relume.errors import RelumeError, UnreadableFile
from relume.studio.library import Library
from relume.studio.pages import PAGE, with_modules
from relume.studio.pictures import Layer, OpenPicture, halved, open_picture
from serving import Server, serving

pytest.importorskip("starlette", reason="the extra studio is not installed")
uvicorn = pytest.importorskip("uvicorn", reason="the extra studio is not installed")

WIDTH, HEIGHT = 1200, 600
VIEW = ("canvas", "commands", "extended", "measured", "programs", "requests", "shaders", "source", "tree")
OVERLAYS = ("beside", "legend", "numbers")


def light() -> rl.RadianceMap:
    """A map with a sun, a value in every binade, and its variance and marks."""
    random = np.random.default_rng(5)
    radiance = np.exp2(random.uniform(-6, 6, (HEIGHT, WIDTH, 3))).astype(np.float32)
    radiance[100, 200] = (70000.5, 65504.0, 3.0000002)
    clipped = np.zeros((HEIGHT, WIDTH), np.uint8)
    clipped[100, 200] = 1
    return rl.RadianceMap(radiance, (0.01 * radiance) ** 2, clipped, "cd/m²", {"mapping": "latlong"})


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("view")
    rl.write(folder / "light.exr", light())
    photograph = np.zeros((40, 60, 3), np.uint8)
    photograph[:] = (0, 128, 255)
    rl.write(folder / "photograph.png", rl.Photograph(photograph))
    (folder / "broken.exr").write_bytes(b"\x76\x2f\x31\x01" + bytes(40))
    (folder.parent / "secret.txt").write_text("secret")
    return [folder / "light.exr", folder / "photograph.png", folder / "broken.exr"]


@pytest.fixture(scope="module")
def server(files: list[Path]) -> Iterator[Server]:
    with serving(files) as running:
        yield running


# Who is let in


def test_the_token_becomes_a_cookie_that_no_script_reads_and_leaves_the_address(server: Server):
    status, headers, _ = server.ask(f"/?token={server.token}&x=1")
    assert (status, headers["location"]) == (303, "/?x=1")
    assert re.fullmatch(
        rf"relume-{server.port}={re.escape(server.token)}; HttpOnly; Path=/; SameSite=strict", headers["set-cookie"]
    )
    status, headers, body = server.ask("/", **server.cookie)
    assert status == 200 and b"<title>relume view</title>" in body
    assert "default-src 'self'" in headers["content-security-policy"]
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff" and "access-control-allow-origin" not in headers


@pytest.mark.parametrize(
    "headers",
    [
        pytest.param({}, id="no token"),
        pytest.param({"Cookie": "relume-PORT=wrong"}, id="wrong cookie"),
        pytest.param({"Cookie": "relume-PORT="}, id="empty cookie"),
        pytest.param({"Authorization": "token wrong"}, id="wrong header"),
        pytest.param({"Cookie": "relume-PORT=TOKEN", "Host": "evil.example:PORT"}, id="foreign host"),
        pytest.param({"Cookie": "relume-PORT=TOKEN", "Host": "127.0.0.1"}, id="host without the port"),
        pytest.param({"Cookie": "relume-PORT=TOKEN", "Host": "127.0.0.1.evil.example:PORT"}, id="host that begins so"),
    ],
)
@pytest.mark.parametrize("path", ["/", "/pictures", "/pictures/0", "/page/view.js"])
def test_strangers_are_refused(server: Server, headers: dict[str, str], path: str):
    given = {
        name: text.replace("PORT", str(server.port)).replace("TOKEN", server.token) for name, text in headers.items()
    }
    assert server.ask(path, **given)[0] == 403


def test_a_wrong_token_in_the_address_sets_no_cookie(server: Server):
    status, headers, _ = server.ask("/?token=wrong")
    assert status == 403 and "set-cookie" not in headers


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:1", None])
def test_websockets_and_changing_requests_of_other_origins_are_refused(server: Server, origin: str | None):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    headers = server.cookie
    given = {} if origin is None else {"Origin": origin}
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{server.port}/events", additional_headers={**headers, **given}).close()
    assert refused.value.response.status_code == 403
    for method in ("POST", "PUT", "DELETE"):
        assert server.ask("/pictures", method=method, **headers, **given)[0] == 403


def test_a_websocket_without_the_token_is_refused_and_with_it_says_what_changed(server: Server, files: list[Path]):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    address, own = f"ws://127.0.0.1:{server.port}/events", {"Origin": f"http://127.0.0.1:{server.port}"}
    with pytest.raises(InvalidStatus):
        connect(address, additional_headers=own).close()
    with connect(address, additional_headers={**own, **server.cookie}) as socket:
        facts = server.json("/pictures/1")
        status = files[1].stat()
        os.utime(files[1], ns=(status.st_atime_ns, status.st_mtime_ns + 10**9))
        assert (
            next(each for each in iter(lambda: socket.recv(timeout=10), "") if "alive" not in str(each))
            == '{"changed":1}'
        )
        # The same pixels have the same address.
        assert server.json("/pictures/1")["layers"] == facts["layers"]


@pytest.mark.parametrize(
    "path",
    [
        "/page/../secret.txt", "/page/../../secret.txt", "/page/%2e%2e/pictures.py", "/page/..%2fpictures.py",
        "/page//etc/passwd", "/page/%2fetc%2fpasswd", "/page/..\\pictures.py", "/../../etc/passwd", "/page/",
        "/tiles/0/0/../0/0/0", "/pictures/-1", "/pictures/3", "/pictures/99999999999999999999",
    ],
)  # fmt: skip
def test_no_way_leads_out_of_the_page(server: Server, path: str):
    status, _, body = server.ask(path, **server.cookie)
    assert status in (404, 405, 410), (status, body[:80])
    assert b"secret" not in body and b"root:" not in body and b"import" not in body


# What it hands out


def test_a_value_is_the_float_of_the_file_with_its_error_mark_and_direction(server: Server):
    value = server.json("/pictures/0/value?x=200&y=100")
    assert value["rgb"] == [70000.5, 65504.0, 3.0000002]
    assert value["mark"] == "saturated in every photograph"
    assert np.array(value["sigma"], np.float32) == pytest.approx(np.array([700.005, 655.04, 0.03]), rel=1e-6)
    # u = 200.5/1200, v = 100.5/600: 119.85° to the left of −Z, 59.85° up.
    assert (value["azimuth"], value["elevation"]) == (-119.85, 59.85)
    expected = (2 * np.pi / WIDTH) * (np.cos(np.pi * 100 / 600) - np.cos(np.pi * 101 / 600))
    assert value["solid_angle"] == pytest.approx(expected, rel=1e-6)
    assert server.ask("/pictures/0/value?x=1200&y=0", **server.cookie)[0] == 404
    assert server.ask("/pictures/0/value?x=abc&y=0", **server.cookie)[0] == 400


def test_values_of_a_box_are_the_files_own_floats(server: Server):
    status, _, body = server.ask("/pictures/0/values?layer=0&box=199,99,3,2", **server.cookie)
    found = np.frombuffer(body, "<f4").reshape(2, 3, 3)
    assert status == 200 and np.array_equal(found, light().radiance[99:101, 199:202])
    for box in ("0,0,4096,4096", "-1,0,2,2", "1199,0,2,1", "0,0,0,5", "1,2,3"):
        assert server.ask(f"/pictures/0/values?box={box}", **server.cookie)[0] in (400, 404)


def test_tiles_hold_the_picture_and_the_levels_its_means(server: Server):
    layer = server.json("/pictures/0")["layers"][0]
    assert layer["sizes"] == [[1200, 600], [600, 300], [300, 150]] and layer["largest"] == 70000.5
    kind = np.dtype("<f2") if layer["half"] else np.dtype("<f4")
    whole = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    for row in range(2):
        for column in range(3):
            w, h = min(512, WIDTH - 512 * column), min(512, HEIGHT - 512 * row)
            path = f"/tiles/0/0/{layer['digest']}/0/{column}/{row}"
            status, headers, body = server.ask(path, **server.cookie)
            assert status == 200 and "immutable" in headers["cache-control"]
            assert server.ask(path, **server.cookie, **{"If-None-Match": headers["etag"]})[0] == 304
            whole[512 * row :, 512 * column :][:h, :w] = np.frombuffer(body, kind).reshape(h, w, 4)
    exact = light().radiance
    # Half floats keep 11 bits; the scale is a power of two.
    assert np.abs(whole[..., :3] * layer["scale"] / exact - 1).max() <= 2**-11
    assert whole[100, 200, 3] == 1 and whole[..., 3].sum() == 1
    body = server.ask(f"/tiles/0/0/{layer['digest']}/1/0/0", **server.cookie)[2]
    level = np.frombuffer(body, kind).reshape(300, 512, 4)[..., :3] * layer["scale"]
    mean = exact.reshape(300, 2, 600, 2, 3).mean((1, 3))[:, :512]
    assert np.abs(level / mean - 1).max() < 2**-10
    assert server.ask(f"/tiles/0/0/{'0' * 24}/0/0/0", **server.cookie)[0] == 410
    assert server.ask(f"/tiles/0/0/{layer['digest']}/0/3/0", **server.cookie)[0] == 404


@pytest.mark.parametrize("shape", [(130, 66), (131, 67), (1, 3)])
def test_a_smaller_picture_is_the_mean_of_its_pixels(shape: tuple[int, int]):
    pixels = np.random.default_rng(4).uniform(size=(*shape, 3)).astype(np.float32)
    even = np.pad(pixels, ((0, shape[0] % 2), (0, shape[1] % 2), (0, 0)), mode="edge")
    mean = even.reshape(len(even) // 2, 2, even.shape[1] // 2, 2, 3).astype(np.float64).mean((1, 3))
    assert halved(pixels) == pytest.approx(mean, rel=3e-7)


@pytest.mark.parametrize(
    ("odd", "count"), [((np.inf, -np.inf), 2), ((np.nan,), 1), ((np.inf,), 1), ((3e38, 3e38), 0), ((), 0)]
)
def test_values_that_are_not_finite_are_counted_and_left_out_of_the_extent(odd: tuple[float, ...], count: int):
    pixels = np.full((20, 20, 3), 0.5, np.float32)
    pixels[3, : len(odd), 1] = odd
    smallest, largest, found = Layer("any", pixels).extent
    assert (smallest, found) == (0.5, count) and largest == np.float32(3e38 if odd == (3e38, 3e38) else 0.5)


def test_the_first_picture_is_opened_before_it_is_asked_for_and_once(
    files: list[Path], monkeypatch: pytest.MonkeyPatch
):
    opened: list[str] = []

    def counted(path: Path) -> OpenPicture:
        opened.append(path.name)
        return open_picture(path)

    monkeypatch.setattr("relume.studio.library.open_picture", counted)
    pictures = Library(files)
    pictures.begin()
    for thread in threading.enumerate():
        if thread.name == "first picture":
            thread.join(20)
    assert opened == [files[0].name]
    assert "digest" in pictures.picture(0).layers[0].__dict__ and opened == [files[0].name]


def test_a_page_asks_for_all_its_modules_at_once(server: Server):
    head = server.ask("/", **server.cookie)[2].decode().split("</head>")[0]
    named = re.findall(r'<link rel="modulepreload" href="/page/([^"]+)"', head)
    modules = [*VIEW, *(f"overlays/{each}" for each in OVERLAYS)]
    assert sorted(named) == sorted(f"{each}.js" for each in modules) and head.index("modulepreload") < head.index(
        "<script"
    )
    for page, among in (("stage/stage.html", "stage/sphere.js"), ("studio.html", "studio/panes/light.js")):
        named = re.findall(r'href="/page/([^"]+\.js)"', with_modules(page))
        assert among in named and "source.js" in named  # what its modules' own modules import
        assert all((PAGE / each).is_file() for each in named) and len(set(named)) == len(named)


def test_statistics_of_a_region_and_of_a_map(server: Server):
    box = light().radiance[100:102, 200:203].reshape(-1, 3).astype(np.float64)
    found = server.json("/pictures/0/statistics?box=200,100,3,2")
    assert found["pixels"] == 6 and found["mean"][:3] == pytest.approx(box.mean(0), rel=1e-12)
    assert found["median"][:3] == pytest.approx(np.median(box, axis=0), rel=1e-12)
    whole = server.json("/pictures/0/statistics")
    assert whole["solid_angle"] == pytest.approx(4 * np.pi, rel=1e-6)
    areas = rl.mappings.LatLong().solid_angles(HEIGHT)[..., None]
    assert whole["total"] == pytest.approx((areas * light().radiance).sum((0, 1)), rel=1e-6)


def test_the_difference_from_a_reference(server: Server):
    found = server.json("/pictures/0/difference?layer=0&other=0&other_layer=0")
    assert (found["rms"], found["signed"], found["psnr"]) == (0.0, 0.0, None)
    # The layer of relative errors is 0.01 everywhere: the signed difference is the mean less that.
    found = server.json("/pictures/0/difference?layer=0&other=0&other_layer=1&box=0,0,50,50")
    assert found["signed"] == pytest.approx(light().radiance[:50, :50].mean() - 0.01, rel=1e-4)
    status, _, body = server.ask("/pictures/0/difference?layer=0&other=1&other_layer=0", **server.cookie)
    assert status == 400 and b"1200" in body and b"only pictures of one size" in body


def test_a_photograph_shows_its_codes_and_linear_light(server: Server):
    value = server.json("/pictures/1/value?x=5&y=5")
    # sRGB's 128 is 0.21586 in linear light.
    assert value["codes"] == [0, 128, 255] and value["rgb"] == pytest.approx([0, 0.2158605, 1], abs=1e-6)


def test_a_damaged_file_is_said_in_one_line_and_the_others_are_shown(server: Server):
    status, _, body = server.ask("/pictures/2", **server.cookie)
    assert status == 422 and b"broken.exr" in body and b"Traceback" not in body
    assert server.json("/pictures")["files"][2]["name"] == "broken.exr"


# Before it begins


def test_other_machines_are_let_in_only_when_that_is_meant(files: list[Path]):
    with pytest.raises(ValueError, match=r"host is 0\.0\.0\.0, which other machines reach"):
        rl.view(files, host="0.0.0.0", open_browser=False)


def test_files_that_are_not_there_and_empty_folders_are_refused(tmp_path: Path):
    with pytest.raises(UnreadableFile, match="no such file"):
        rl.view([tmp_path / "none.exr"], open_browser=False)
    with pytest.raises(ValueError, match="this folder holds no picture that relume reads"):
        rl.view([tmp_path], open_browser=False)


def test_a_port_that_is_taken_is_refused(server: Server, files: list[Path]):
    with pytest.raises(RelumeError, match=rf"127\.0\.0\.1:{server.port} cannot be listened at"):
        rl.view(files, port=server.port, open_browser=False)
