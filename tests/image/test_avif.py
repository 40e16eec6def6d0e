"""AVIF pictures for HDR screens, read back by another decoder."""

from pathlib import Path

import av
import numpy as np
import pytest

from relume.errors import OutputNotWritten
from relume.image.files.photographs.avif import HLG, PQ, write_avif

LUMA = np.array([0.2627, 0.6780, 0.0593])  # BT.2020


def planes(signal: np.ndarray) -> list[np.ndarray]:
    """Luma and both chroma of 10 bits, full range (BT.2100-2, tables 6 and 9), in whole arrays."""
    share = signal / 65535
    luma = share @ LUMA
    chroma = ((share[..., 2] - luma) / 1.8814, (share[..., 0] - luma) / 1.4746)
    height, width = luma.shape
    full = [np.pad(c, ((0, height % 2), (0, width % 2)), mode="edge") for c in chroma]
    means = [c.reshape(c.shape[0] // 2, 2, -1, 2).mean((1, 3)) for c in full]
    return [1023 * luma, *(1023 * mean + 512 for mean in means)]


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


@pytest.mark.parametrize("transfer", [PQ, HLG])
def test_a_file_names_its_colours_and_has_ten_bits(tmp_path, transfer):
    write_avif(tmp_path / "a.avif", smooth(64, 96), transfer)
    frame, _ = read_back(tmp_path / "a.avif")
    assert (frame.format.name, frame.width, frame.height) == ("yuv420p10le", 96, 64)
    colours = (int(frame.color_primaries), int(frame.color_trc), int(frame.colorspace), int(frame.color_range))
    assert colours == (9, {PQ: 16, HLG: 18}[transfer], 9, 2)
    data = (tmp_path / "a.avif").read_bytes()
    # The container's own box, which browsers heed: primaries, transfer, matrix, and the bit of full range.
    place = data.index(b"colrnclx") + 8
    assert data[place : place + 7] == bytes((0, 9, 0, transfer, 0, 9, 0x80))
    assert data[4:12] == b"ftypavif"


def test_a_neutral_ramp_comes_back_to_one_code(tmp_path):
    ramp = np.rint(np.linspace(0, 65535, 1024))[None, :, None].repeat(3, axis=2).repeat(64, axis=0).astype(np.uint16)
    write_avif(tmp_path / "a.avif", ramp, PQ)
    _, (luma, blue, red) = read_back(tmp_path / "a.avif")
    assert np.abs(luma - np.arange(1024)).max() <= 1
    assert np.all(blue == 512) and np.all(red == 512)


@pytest.mark.parametrize("shape", [(65, 77), (64, 64), (101, 130), (16, 130), (1, 1), (5, 3)])
def test_every_size_keeps_every_pixel(tmp_path, shape):
    signal = smooth(*shape)
    write_avif(tmp_path / "a.avif", signal, HLG)
    _, found = read_back(tmp_path / "a.avif")
    for plane, expected in zip(found, planes(signal), strict=True):
        assert plane.shape == expected.shape
        assert np.abs(plane - expected).max() <= 6


def test_the_same_input_makes_the_same_file(tmp_path):
    noisy = np.random.default_rng(2).integers(20000, 40000, (96, 96, 3)).astype(np.uint16)
    for name in ("one.avif", "again.avif"):
        write_avif(tmp_path / name, noisy, PQ)
    assert (tmp_path / "one.avif").read_bytes() == (tmp_path / "again.avif").read_bytes()


def test_a_size_that_av1_has_not_is_refused(tmp_path):
    with pytest.raises(ValueError, match="70000×1 pixels"):
        write_avif(tmp_path / "a.avif", smooth(1, 70_000), PQ)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(OutputNotWritten, match="does not exist"):
        write_avif(tmp_path / "none" / "a.avif", smooth(64, 64), PQ)
