"""Radiance pictures: RGBE and XYZE, flat, in old and new runs, and in all eight axis orders.

Formats: the Radiance manual "filefmts", Ward's "Real Pixels" (Graphics Gems II, 1991): a pixel is m·2^(e − 136).
"""

from __future__ import annotations

import numpy as np

from corpus.files import HEIGHT, WIDTH, Bad, Corpus, Good, cut, replaced

_SUFFIX = ".hdr"
_AXES = ("-Y +X", "-Y -X", "+Y +X", "+Y -X", "+X -Y", "+X +Y", "-X -Y", "-X +Y")
_SIZES = ("0", "-1", "", "1e1", "0x8", "8.0", "65537", "2147483647", "2147483648", "4294967295", "9" * 25, "٨")


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("Radiance", _good(), _bad())


def header(*lines: str, size: str = f"-Y {HEIGHT} +X {WIDTH}", form: str = "32-bit_rle_rgbe") -> bytes:
    """The text before the pixels."""
    return "\n".join(["#?RADIANCE", *lines, f"FORMAT={form}", "", size, ""]).encode("utf-8")


def _codes(height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """(H, W, 4) uint8: mantissas of at least 128, as writers leave them, in the largest channel; some runs."""
    random = np.random.default_rng(5)
    codes = random.integers(0, 256, (height, width, 4), np.uint8)
    codes[..., 0] |= 128
    codes[..., 3] = random.integers(120, 140, (height, width))
    codes[:, 4 : width // 2 + 2] = codes[:, 4:5]
    codes[0, 0] = 0
    return codes


def _values(codes: np.ndarray) -> np.ndarray:
    values = np.ldexp(codes[..., :3].astype(np.float64), codes[..., 3:].astype(int) - 136)
    return np.where(codes[..., 3:] == 0, 0, values)


def _new_runs(codes: np.ndarray) -> bytes:
    """Each line: 2, 2, its width, then its four channels apart in runs (128 + n, byte) and stretches (n, bytes)."""
    out = bytearray()
    for line in codes:
        out += bytes([2, 2, len(line) >> 8, len(line) & 255])
        for channel in line.T:
            place = 0
            while place < len(channel):
                end = place
                while end < len(channel) and end - place < 127 and channel[end] == channel[place]:
                    end += 1
                if end - place < 3:
                    end = min(len(channel), place + 5)
                    out += bytes([end - place]) + channel[place:end].tobytes()
                else:
                    out += bytes([128 + end - place, channel[place]])
                place = end
    return bytes(out)


def _old_runs(codes: np.ndarray) -> bytes:
    """Whole pixels; (1, 1, 1, n) repeats the one before n times, and a second such one n · 256 times more."""
    out, pixels = bytearray(), codes.reshape(-1, 4)
    place = 0
    while place < len(pixels):
        end = place + 1
        while end < len(pixels) and np.array_equal(pixels[end], pixels[place]):
            end += 1
        out += pixels[place].tobytes()
        if end - place > 1:
            count = end - place - 1
            out += bytes([1, 1, 1, count & 255]) + (bytes([1, 1, 1, count >> 8]) if count > 255 else b"")
        place = end
    return bytes(out)


def _upright(stored: np.ndarray, axes: str) -> np.ndarray:
    """What a picture shows whose scan lines and their pixels go the ways that `axes` says."""
    lines, along = axes.split()
    if lines[1] == "X":
        stored, lines, along = stored.transpose(1, 0, 2), along, lines
    stored = stored if lines[0] == "-" else stored[::-1]  # Y counts upwards
    return stored if along[0] == "+" else stored[:, ::-1]


def _good() -> list[Good]:
    codes = _codes()
    values = _values(codes)
    wide = np.repeat(codes[:, 4:5], 600, axis=1)
    files = [
        Good("flat", header() + codes.tobytes(), _SUFFIX, values),
        Good("new runs", header() + _new_runs(codes), _SUFFIX, values),
        Good("old runs", header() + _old_runs(codes), _SUFFIX, values),
        Good("old runs beyond 255", header(size="-Y 8 +X 600") + _old_runs(wide), _SUFFIX, _values(wide)),
        Good("XYZE", header(form="32-bit_rle_xyze") + _new_runs(codes), _SUFFIX),
        Good(
            "exposures",
            header("EXPOSURE=2", "VIEW= -vth", "EXPOSURE= 0.25", "COLORCORR=1 2 4", "PIXASPECT=1") + _new_runs(codes),
            _SUFFIX,
            values / (0.5 * np.array([1, 2, 4])),
        ),
        Good("narrow", header(size="-Y 8 +X 7") + codes[:, :7].tobytes(), _SUFFIX, values[:, :7]),
    ]
    for axes in _AXES[1:]:  # the first is that of all the others
        lines, along = axes.split()
        size = f"{lines} {HEIGHT} {along} {WIDTH}"
        files.append(Good(f"axes {axes}", header(size=size) + _new_runs(codes), _SUFFIX, _upright(values, axes)))
    return [file if file.pixels is None else _relative(file) for file in files]


def _relative(file: Good) -> Good:
    return Good(file.name, file.data, file.suffix, file.pixels, 1e-6)


def _bad() -> list[Bad]:
    codes = _codes()
    flat, new, old = codes.tobytes(), _new_runs(codes), _old_runs(codes)
    bad: list[tuple[str, bytes]] = []
    for size in _SIZES:
        bad.append((f"height {size!r}", header(size=f"-Y {size} +X 16") + new))
        bad.append((f"width {size!r}", header(size=f"-Y 8 +X {size}") + new))
    bad += [
        (f"resolution line {line!r}", header(size=line) + new)
        for line in (
            "",
            "-Y 8",
            "-Y 8 +Y 16",
            "+X 16 +X 8",
            "-Z 8 +X 16",
            "Y 8 X 16",
            "8 16",
            "-Y 8 +X 16 +Z 4",
            "-Y8+X",
        )
    ]
    bad += [
        ("no empty line", replaced(header(), b"\n\n", b"\n") + flat),
        ("no resolution line", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + flat),
        ("a header alone", header()),
        ("a header that does not end", b"#?RADIANCE\n" + b"COMMENT=abcdefgh\n" * 4000),
        ("a line of a megabyte that does not end", b"#?RADIANCE\nA=" + b"x" * 2**20),
        ("line ends converted", (header() + new).replace(b"\n", b"\r\n")),
        ("an unknown format", header(form="32-bit_rle_cmyk") + new),
        ("a format of 96 bits", header(form="96-bit_float_rgb") + new),
        ("an exposure of nothing", header("EXPOSURE=0") + new),
        ("an exposure that is no number", header("EXPOSURE=nan") + new),
        ("an exposure without end", header("EXPOSURE=inf") + new),
        ("an exposure beyond doubles", header("EXPOSURE=1e999") + new),
        ("an exposure of letters", header("EXPOSURE=bright") + new),
        ("an exposure without value", header("EXPOSURE=") + new),
        ("a negative exposure", header("EXPOSURE=-2") + new),
        ("a colour correction of two", header("COLORCORR=1 2") + new),
        ("a colour correction of nothing", header("COLORCORR=1 0 1") + new),
        ("a colour correction that is no number", header("COLORCORR=1 nan 1") + new),
        ("a colour correction of letters", header("COLORCORR=a b c") + new),
        ("a scan line of another width", header() + bytes([2, 2, 0, 15]) + new[4:]),
        ("a scan line of a width of 2^15 − 1", header() + bytes([2, 2, 127, 255]) + new[4:]),
        ("a scan line of width 0", header() + bytes([2, 2, 0, 0]) + new[4:]),
        ("a run beyond its scan line", header() + bytes([2, 2, 0, 16, 128 + 17, 9]) + new[6:]),
        ("a run of 127 in a line of 16", header() + bytes([2, 2, 0, 16, 255, 9]) + new[6:]),
        ("a stretch beyond its scan line", header() + bytes([2, 2, 0, 16, 17]) + bytes(17) + new[6:]),
        ("a stretch of nothing", header() + bytes([2, 2, 0, 16, 0]) + new[5:]),
        ("nothing but stretches of nothing", header() + bytes([2, 2, 0, 16]) + bytes(4000)),
        ("later lines without the mark of runs", header() + _new_runs(codes[:1]) + flat[: 4 * 60]),
        ("the mark of runs and no runs", header() + bytes([2, 2, 0, 16])),
        ("a run without its byte", header() + bytes([2, 2, 0, 16, 128 + 16])),
        ("old runs beyond the picture", header() + flat[:4] + bytes([1, 1, 1, 255]) * 2 + old[8:]),
        ("old runs that multiply", header() + flat[:4] + bytes([1, 1, 1, 255]) * 9),
        ("old runs of nothing for ever", header() + flat[:4] + bytes([1, 1, 1, 0]) * 200),
        ("an old run before any pixel", header() + bytes([1, 1, 1, 7]) + flat[4:80]),
        ("a picture of 2^28 pixels in 100 bytes", header(size="-Y 16384 +X 16384") + bytes(100)),
        ("65536 lines in 100 bytes", header(size="-Y 65536 +X 1") + bytes(100)),
        ("one line of 65536 in 100 bytes", header(size="-Y 1 +X 65536") + bytes(100)),
    ]
    for name, data in (("flat", flat), ("new runs", new), ("old runs", old)):
        whole = header() + data
        start = len(header()) + len(name)
        bad += [(f"{name}, ends at {at} of {len(whole)}", whole[:at]) for at in (start + 3, start + 50, -9, -4, -1)]
    files = [Bad(name, data, _SUFFIX) for name, data in bad]
    lenient = [
        ("primaries of seven", header("PRIMARIES=.64 .33 .3 .6 .15 .06 .3127") + new),
        ("primaries on one line", header("PRIMARIES=.1 .1 .2 .2 .3 .3 .4 .4") + new),
        ("primaries that are no numbers", header("PRIMARIES=" + "nan " * 8) + new),
        ("primaries of letters", header("PRIMARIES=a b c d e f g h") + new),
        ("primaries with white at y = 0", header("PRIMARIES=.64 .33 .3 .6 .15 .06 .3127 0") + new),
        ("primaries beyond doubles", header("PRIMARIES=" + "1e200 " * 8) + new),
        ("pixels without aspect", header("PIXASPECT=0") + new),
        ("pixels whose aspect is no number", header("PIXASPECT=nan") + new),
        ("pixels with an aspect of letters", header("PIXASPECT=wide") + new),
        ("exposures whose product overflows", header(*["EXPOSURE=1e30"] * 20) + new),
        ("exposures whose product vanishes", header(*["EXPOSURE=1e-30"] * 20) + new),
        ("an exposure in figures of another script", header("EXPOSURE=٢") + new),
        ("an exposure with underscores", header("EXPOSURE=1_0") + new),
        ("fifty thousand exposures", header(*["EXPOSURE=1"] * 50_000) + new),
        ("fifty thousand comments", header(*["a b c"] * 50_000) + new),
        ("two formats", header("FORMAT=32-bit_rle_xyze") + new),
        ("bytes that are no text", replaced(header("VIEW=x"), b"VIEW=x", b"VIEW=\xff\xfe\x80") + new),
        ("a NUL in the header", replaced(header("VIEW=x"), b"VIEW=x", b"VIEW=\0\0") + new),
        ("escapes in the header", replaced(header("VIEW=x"), b"VIEW=x", b"VIEW=\x1b[2J\r") + new),
        ("a line without a name", header("=5", "==", "=") + new),
        ("bytes after the picture", header() + new + bytes(999)),
        ("a flat line that looks like runs", header(size="-Y 8 +X 7") + bytes([2, 2, 0, 7]) + flat[4 : 4 * 56]),
        ("the largest exponents", header() + bytes([255, 255, 255, 255]) * (WIDTH * HEIGHT)),
    ]
    files += [Bad(name, data, _SUFFIX, refused=False) for name, data in lenient]
    return files + cut("axes +X -Y", header(size="+X 16 -Y 8") + flat, _SUFFIX, (-1, -64))
