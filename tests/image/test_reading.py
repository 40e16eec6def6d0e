"""The limits of reading: each stands where it says, can be moved, and holds before anything is allocated."""

import io
from dataclasses import replace

import pytest

from relume.errors import UnreadableFile
from relume.image.files import read_options as module
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size


@pytest.fixture
def free(monkeypatch):
    """Sets the memory that the machine says it has free, in KiB."""

    def set_to(text: str | None) -> None:
        def opened(*_, **__):
            if text is None:
                raise FileNotFoundError
            return io.StringIO(text)

        monkeypatch.setattr(module, "open", opened, raising=False)

    return set_to


def test_the_defaults_are_these():
    limits = ReadOptions()
    assert (limits.side, limits.pixels, limits.channels) == (65536, 268435456, 64)
    assert (limits.decoded, limits.ratio, limits.metadata, limits.parts) == (8589934592, 10000, 16777216, 1024)
    assert (limits.salvage, limits.mantissa_middle, limits.float_size, limits.float_order) == (False, False, None, None)


@pytest.mark.parametrize("name", ["side", "pixels", "channels", "decoded", "ratio", "metadata", "parts"])
def test_a_limit_below_one_is_refused(name):
    assert getattr(replace(ReadOptions(), **{name: 1}), name) == 1
    with pytest.raises(ValueError, match=f"{name} is 0; a limit is at least 1"):
        replace(ReadOptions(), **{name: 0})


@pytest.mark.parametrize(
    ("width", "height", "refused"),
    [
        (65536, 4096, False),  # exactly 2²⁸ pixels
        (65536, 4097, True),
        (65537, 1, True),
        (1, 65537, True),
        (1, 1, False),
        (0, 1, True),
        (1, 0, True),
        (-1, -1, True),
    ],
)
def test_sizes_are_refused_beyond_the_limits(width, height, refused):
    if not refused:
        refuse_absurd_size("a.hdr", width, height)
        return
    with pytest.raises(UnreadableFile, match=f"a.hdr: its header claims {width} x {height} pixels"):
        refuse_absurd_size("a.hdr", width, height)


def test_limits_of_sizes_can_be_moved():
    refuse_absurd_size("a.hdr", 100_000, 5000, ReadOptions(side=100_000, pixels=10**9))
    with pytest.raises(UnreadableFile, match="its tag claims 11 x 2 pixels; relume reads sides up to 10 and 268435456"):
        refuse_absurd_size("a.hdr", 11, 2, ReadOptions(side=10), where="its tag")
    with pytest.raises(UnreadableFile, match="sides up to 65536 and 21 pixels in all"):
        refuse_absurd_size("a.hdr", 11, 2, ReadOptions(pixels=21))


def test_more_than_the_limit_of_bytes_is_refused(free):
    free("MemAvailable: 100000000 kB\n")
    refuse_absurd_amount("a.hdr", 2**33, 2**33)
    with pytest.raises(UnreadableFile, match=r"claims 8589934593 bytes of pixels; relume decodes 8589934592 here"):
        refuse_absurd_amount("a.hdr", 2**33 + 1, 2**33)
    refuse_absurd_amount("a.hdr", 2**33 + 1, 2**33, ReadOptions(decoded=2**34))


def test_more_than_half_of_the_free_memory_is_refused(free):
    free("MemTotal: 9 kB\nMemAvailable: 1000 kB\nBuffers: 9 kB\n")
    refuse_absurd_amount("a.hdr", 512_000, 512_000)
    for limits in (ReadOptions(), ReadOptions(decoded=2**40)):
        with pytest.raises(UnreadableFile, match="relume decodes 512000 here"):
            refuse_absurd_amount("a.hdr", 512_001, 512_001, limits)


@pytest.mark.parametrize("text", [None, "MemTotal: 9 kB\n", "MemAvailable: much\n"])
def test_a_machine_that_does_not_say_its_memory_has_the_other_limits(free, text):
    free(text)
    refuse_absurd_amount("a.hdr", 2**33, 2**33)
    with pytest.raises(UnreadableFile, match="relume decodes 8589934592 here"):
        refuse_absurd_amount("a.hdr", 2**33 + 1, 2**33)


def test_pixels_that_the_file_cannot_hold_are_refused_above_64_mebibytes(free):
    free(None)
    refuse_absurd_amount("a.hdr", 2**26, 1)
    with pytest.raises(UnreadableFile, match="67108865 bytes of pixels, which 1 bytes of file cannot hold"):
        refuse_absurd_amount("a.hdr", 2**26 + 1, 1)
    refuse_absurd_amount("a.hdr", 10_000 * 8000, 8000)
    with pytest.raises(UnreadableFile, match="cannot hold"):
        refuse_absurd_amount("a.hdr", 10_000 * 8000 + 1, 8000)
    refuse_absurd_amount("a.hdr", 10_000 * 8000 + 1, 8000, ReadOptions(ratio=10_001))


def test_flat_pictures_of_formats_that_pack_them_have_no_ratio_but_the_other_limits(free):
    free(None)
    refuse_absurd_amount("a.exr", 2**30, 100, flat=True)
    with pytest.raises(UnreadableFile, match="relume decodes"):
        refuse_absurd_amount("a.exr", 2**34, 100, flat=True)
