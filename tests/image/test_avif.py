"""AVIF pictures for HDR screens, read back by another decoder."""

import builtins
import sys
from pathlib import Path

import av
import numpy as np
import pytest

from relume.errors import OutputNotWritten
from relume.image.files.photographs.avif import HLG, PQ, planes, write_avif

MATRIX = np.array([[0.2627, 0.6780, 0.0593]])  # of luma (BT.2020)


def naive_planes(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """BT.2100-2, tables 6 and 9, in whole arrays: the slow twin of the kernel."""
    share = signal / 65535
    luma = share @ MATRIX[0]
    chroma = ((share[..., 2] - luma) / 1.8814, (share[..., 0] - luma) / 1.4746)
    height, width = luma.shape
    full = [np.pad(c, ((0, height % 2), (0, width % 2)), mode="edge") for c in chroma]
    means = [c.reshape(c.shape[0] // 2, 2, -1, 2).mean((1, 3)) for c in full]
    halves = [np.clip(np.floor(1023 * mean + 512.5), 0, 1023) for mean in means]
    return np.floor(1023 * luma + 0.5).astype(np.uint16), *(half.astype(np.uint16) for half in halves)  # pyright: ignore[reportReturnType]


def read_back(path: Path) -> tuple[av.VideoFrame, list[np.ndarray]]:
    with av.open(str(path)) as container:
        frame = next(container.decode(video=0))
    assert isinstance(frame, av.VideoFrame)
    return frame, [
        np.frombuffer(bytes(p), np.uint16).reshape(p.height, -1)[:, : p.width].astype(int) for p in frame.planes
    ]


def smooth(height: int, width: int) -> np.ndarray:
    y, x = np.mgrid[:height, :width] / max(height, width)
    return np.rint(65535 * np.stack([0.2 + 0.6 * x, 0.5 + 0.3 * y, 0.7 - 0.5 * x * y], -1)).astype(np.uint16)


@pytest.mark.parametrize("shape", [(6, 8), (7, 5), (1, 1), (130, 3)])
def test_planes_are_bt_2100_s(shape):
    signal = np.random.default_rng(1).integers(0, 65536, (*shape, 3)).astype(np.uint16)
    for found, expected in zip(planes(signal), naive_planes(signal), strict=True):
        assert np.array_equal(found, expected)


def test_planes_of_plain_colours():
    signal = np.array([[[65535, 65535, 65535], [65535, 65535, 65535]], [[0, 0, 0], [0, 0, 0]]], np.uint16)
    luma, blue, red = planes(signal)
    assert luma.tolist() == [[1023, 1023], [0, 0]] and blue.tolist() == red.tolist() == [[512]]
    luma, blue, red = planes(np.full((2, 2, 3), [65535, 0, 0], np.uint16))
    assert luma[0, 0] == 269 and blue[0, 0] == 369 and red[0, 0] == 1023  # 1023 · 0.2627; 512 − 142.8; the most
    luma, blue, red = planes(np.full((2, 2, 3), [0, 0, 65535], np.uint16))
    assert luma[0, 0] == 61 and blue[0, 0] == 1023 and red[0, 0] == 471


@pytest.mark.parametrize("transfer", [PQ, HLG])
def test_a_file_tells_its_colours_and_has_ten_bits(tmp_path, transfer):
    write_avif(tmp_path / "a.avif", smooth(64, 96), transfer)
    frame, _ = read_back(tmp_path / "a.avif")
    assert (frame.format.name, frame.width, frame.height) == ("yuv420p10le", 96, 64)
    assert (int(frame.color_primaries), int(frame.color_trc), int(frame.colorspace)) == (
        9,
        {PQ: 16, HLG: 18}[transfer],
        9,
    )
    assert int(frame.color_range) == 2
    data = (tmp_path / "a.avif").read_bytes()
    # The container's own word, which browsers heed: primaries, transfer, matrix, and the bit of full range.
    place = data.index(b"colrnclx") + 8
    assert data[place : place + 7] == bytes((0, 9, 0, transfer, 0, 9, 0x80))
    assert data[4:12] == b"ftypavif"


def test_a_neutral_ramp_comes_back_to_one_code(tmp_path):
    ramp = (
        np.repeat(np.rint(np.linspace(0, 65535, 1024))[None, :, None], 3, axis=2).repeat(64, axis=0).astype(np.uint16)
    )
    write_avif(tmp_path / "a.avif", ramp, PQ)
    _, (luma, blue, red) = read_back(tmp_path / "a.avif")
    assert np.abs(luma - np.arange(1024)).max() <= 1
    assert np.all(blue == 512) and np.all(red == 512)


@pytest.mark.parametrize("shape", [(65, 77), (64, 64), (101, 130)])
def test_odd_sizes_keep_every_pixel(tmp_path, shape):
    signal = smooth(*shape)
    write_avif(tmp_path / "a.avif", signal, HLG)
    _, found = read_back(tmp_path / "a.avif")
    for plane, expected in zip(found, planes(signal), strict=True):
        assert plane.shape == expected.shape
        assert np.abs(plane - expected.astype(int)).max() <= 6


def test_a_coarser_rate_makes_a_smaller_file_and_the_same_input_the_same_file(tmp_path):
    noisy = np.random.default_rng(2).integers(20000, 40000, (96, 96, 3)).astype(np.uint16)
    for name, rate in (("fine", 2), ("again", 2), ("coarse", 40)):
        write_avif(tmp_path / f"{name}.avif", noisy, PQ, rate_factor=rate)
    fine, again, coarse = ((tmp_path / f"{name}.avif").read_bytes() for name in ("fine", "again", "coarse"))
    assert fine == again and len(coarse) < len(fine) / 2


def test_without_pyav_it_is_said_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(ValueError, match=r'needs PyAV.*pip install "relume\[video\]"'):
        write_avif(tmp_path / "a.avif", smooth(64, 64), PQ)
    assert not list(tmp_path.iterdir())


def test_without_the_encoder_it_is_said_too(tmp_path, monkeypatch):
    monkeypatch.setattr(av, "codecs_available", builtins.set())
    with pytest.raises(ValueError, match="built without SVT-AV1"):
        write_avif(tmp_path / "a.avif", smooth(64, 64), PQ)


@pytest.mark.parametrize(
    "name, signal, transfer, rate, said",
    [
        ("a.png", smooth(64, 64), PQ, 2, "written to .avif"),
        ("a.avif", smooth(17, 130), PQ, 2, "the picture is 130×17; an AVIF by SVT-AV1 is 64×64 to"),
        ("a.avif", smooth(64, 64).astype(np.uint8), PQ, 2, "expected \\(H, W, 3\\) uint16"),
        ("a.avif", smooth(64, 64), 13, 2, "transfer is 13"),
        ("a.avif", smooth(64, 64), PQ, 0, "rate_factor is 0"),
    ],
)
def test_what_it_does_not_write_is_refused(tmp_path, name, signal, transfer, rate, said):
    with pytest.raises(ValueError, match=said):
        write_avif(tmp_path / name, signal, transfer, rate_factor=rate)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(OutputNotWritten, match="does not exist"):
        write_avif(tmp_path / "none" / "a.avif", smooth(64, 64), PQ)


def test_an_encoder_that_fails_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.avif"
    path.write_bytes(b"old")

    def failing(*_: object, **__: object) -> object:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(av, "open", failing)
    with pytest.raises(OutputNotWritten, match="No space left"):
        write_avif(path, smooth(64, 64), PQ)
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]
