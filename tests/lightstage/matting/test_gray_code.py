"""Stripes, their pictures in a folder, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.lightstage.matting.gray_code import Patterns, Stripes, disorder, gray_stripes, plain_stripes, read_patterns

LEVELS, TEXELS = 6, 64


def seen(stripes: Stripes, size: int = 96) -> np.ndarray:
    """The picture (size, size, 3) of stripes that fill it, of light 2 on black 0.25, a lens bending its middle."""
    across = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(across, across)
    bent = np.hypot(u - 0.5, v - 0.5) < 0.2
    u, v = np.where(bent, 1 - u, u), np.where(bent, 1 - v, v)
    place = ((u if stripes.axis == "x" else v) * len(stripes.white)).astype(int)
    picture = 0.25 + 2.0 * stripes.white[place]
    return np.repeat(picture[..., None], 3, axis=2).astype(np.float32)


def all_stripes() -> tuple[Stripes, ...]:
    return tuple(gray_stripes(axis, level, TEXELS) for axis in "xy" for level in range(LEVELS))


def patterns() -> Patterns:
    stripes = all_stripes()
    black = np.full((96, 96, 3), 0.25, np.float32)
    return Patterns(black, black + 2, np.stack([seen(stripe) for stripe in stripes]), stripes)


def write(folder: Path, shown: Patterns, leave_out: tuple[str, ...] = ()) -> None:
    named = {"black": shown.black, "white": shown.white}
    named |= {stripe.name: picture for stripe, picture in zip(shown.stripes, shown.pictures, strict=True)}
    for name, picture in named.items():
        if name not in leave_out:
            files.write(folder / f"{name}.exr", RadianceMap(picture))


def exchanged(shown: Patterns, first: int, second: int) -> Patterns:
    order = np.arange(len(shown.pictures))
    order[[first, second]] = order[[second, first]]
    return replace(shown, pictures=shown.pictures[order])


def test_the_gray_code_of_eight_texels_is_the_printed_one():
    said = [gray_stripes("x", level, 8).white.astype(int).tolist() for level in range(3)]
    assert said == [[0, 0, 0, 0, 1, 1, 1, 1], [0, 0, 1, 1, 1, 1, 0, 0], [0, 1, 1, 0, 0, 1, 1, 0]]


@pytest.mark.parametrize("texels", [256, 200])
def test_neighbouring_texels_differ_in_one_level_and_all_texels_differ(texels):
    codes = np.stack([gray_stripes("y", level, texels).white for level in range(8)])
    assert np.all(np.sum(codes[:, 1:] != codes[:, :-1], axis=0) == 1)
    assert len(np.unique(codes, axis=1).T) == texels


def test_inverse_stripes_are_white_where_the_others_are_black():
    assert np.array_equal(gray_stripes("x", 2, 16, inverse=True).white, ~gray_stripes("x", 2, 16).white)
    assert plain_stripes("y", 2, 8, inverse=True).white.astype(int).tolist() == [1, 1, 0, 0, 1, 1, 0, 0]


def test_levels_and_widths_beyond_the_backdrop_are_refused():
    with pytest.raises(ValueError, match="levels 0 … 2"):
        gray_stripes("x", 3, 8)
    with pytest.raises(ValueError, match="expected 1 … 7"):
        plain_stripes("x", 8, 8)


def test_a_folder_is_read_by_its_names(tmp_path):
    shown = patterns()
    write(tmp_path, shown)
    (tmp_path / "notes.txt").write_text("a rainy day")
    read = read_patterns(tmp_path)
    assert read.texels == (64, 64) and np.array_equal(read.white, shown.white)
    names = [stripe.name for stripe in read.stripes]
    assert sorted(names) == sorted(stripe.name for stripe in shown.stripes)
    third = names.index("gray_y3")
    assert np.array_equal(read.pictures[third], shown.pictures[LEVELS + 3])
    assert np.array_equal(read.stripes[third].white, shown.stripes[LEVELS + 3].white)


def test_a_list_of_patterns_says_the_same_as_the_names(tmp_path):
    shown = patterns()
    write(tmp_path, shown)
    plain = plain_stripes("x", 4, TEXELS, inverse=True)
    files.write(tmp_path / "odd.exr", RadianceMap(seen(plain)))
    entries: list[dict[str, object]] = [
        {"file": f"gray_{axis}{level}.exr", "stripes": "gray", "axis": axis, "level": level}
        for axis in "xy"
        for level in range(LEVELS)
    ]
    entries.append({"file": "odd.exr", "stripes": "plain", "axis": "x", "width": 4, "inverse": True})
    table = {"texels": [TEXELS, TEXELS], "black": "black.exr", "white": "white.exr", "patterns": entries}
    (tmp_path / "patterns.json").write_text(json.dumps(table))
    read = read_patterns(tmp_path)
    assert np.array_equal(read.pictures[:-1], shown.pictures) and np.array_equal(read.stripes[-1].white, plain.white)
    entries[0]["axis"] = "z"
    (tmp_path / "patterns.json").write_text(json.dumps(table))
    with pytest.raises(UnreadableFile, match=r'patterns.json: .*axis "z"'):
        read_patterns(tmp_path)
    del table["black"]
    (tmp_path / "patterns.json").write_text(json.dumps({**table, "patterns": entries[1:]}))
    with pytest.raises(UnreadableFile, match="the key 'black' is missing"):
        read_patterns(tmp_path)
    (tmp_path / "patterns.json").write_text("{")
    with pytest.raises(UnreadableFile, match="not a list of patterns"):
        read_patterns(tmp_path)


@pytest.mark.parametrize("name", ["black", "white", "gray_x0", "gray_x3", "gray_y2"])
def test_a_missing_picture_is_named(tmp_path, name):
    write(tmp_path, patterns(), leave_out=(name,))
    with pytest.raises(UnreadableFile, match=name) as said:
        read_patterns(tmp_path)
    assert "\n" not in str(said.value)


def test_two_sizes_and_two_pictures_of_one_pattern_are_named(tmp_path):
    write(tmp_path, patterns())
    files.write(tmp_path / "gray_x2.exr", RadianceMap(np.ones((96, 95, 3), np.float32)))
    with pytest.raises(UnreadableFile, match=r"gray_x2.exr: 95×96 pixels, but black.exr has 96×96"):
        read_patterns(tmp_path)
    files.write(tmp_path / "gray_x2.pfm", RadianceMap(np.ones((96, 96, 3), np.float32)))
    with pytest.raises(UnreadableFile, match=r"gray_x2.exr is there too"):
        read_patterns(tmp_path)
    with pytest.raises(UnreadableFile, match="no folder"):
        read_patterns(tmp_path / "nowhere")


@pytest.mark.parametrize("axis", [0, LEVELS])
@pytest.mark.parametrize("pair", [(0, 1), (1, 2), (0, 2), (2, 3), (4, 5), (0, 5)])
def test_two_exchanged_pictures_are_found_out(axis, pair):
    shown = patterns()
    assert disorder(shown) == ""
    wrong = disorder(exchanged(shown, axis + pair[0], axis + pair[1]))
    assert "out of order" in wrong and "\n" not in wrong


def test_reversed_order_and_exchanged_axes_are_found_out(tmp_path):
    shown = patterns()
    assert "out of order" in disorder(
        replace(shown, pictures=np.concatenate([shown.pictures[5::-1], shown.pictures[6:]]))
    )
    turned = replace(shown, pictures=np.roll(shown.pictures, LEVELS, axis=0))
    assert "exchange x and y" in disorder(turned)
    write(tmp_path, turned)
    with pytest.raises(UnreadableFile, match="exchange x and y"):
        read_patterns(tmp_path)


@pytest.mark.parametrize("left", [0, 20, 48, 70])
def test_a_part_of_the_backdrop_is_in_order_too(left):
    shown, part = patterns(), (slice(30, 70), slice(left, left + 26))
    cut = Patterns(shown.black[part], shown.white[part], shown.pictures[:, *part], shown.stripes)
    assert disorder(cut) == ""


def test_stripes_with_their_inverse_pictures_are_in_order():
    shown = patterns()
    inverse = tuple(gray_stripes(s.axis, int(s.name[-1]), TEXELS, inverse=True) for s in shown.stripes)
    pictures = np.concatenate([shown.pictures, np.stack([seen(stripe) for stripe in inverse])])
    both = Patterns(shown.black, shown.white, pictures, shown.stripes + inverse)
    assert disorder(both) == ""
    assert "out of order" in disorder(exchanged(both, 0, 1))


def test_black_and_white_exchanged_and_pixels_that_are_no_numbers_are_refused():
    shown = patterns()
    with pytest.raises(ValueError, match="no brighter"):
        replace(shown, black=shown.white, white=shown.black)
    with pytest.raises(ValueError, match="12 stripe patterns"):
        replace(shown, pictures=shown.pictures[:-1])
    with pytest.raises(ValueError, match="NaN"):
        replace(shown, white=np.where(np.arange(3) == 1, np.nan, shown.white))
    with pytest.raises(ValueError, match="along y the backdrop has no stripes"):
        replace(shown, stripes=shown.stripes[:LEVELS])


def test_photographs_are_taken_as_srgb_and_that_is_said(tmp_path):
    shown = patterns()
    for name, picture in [
        ("black", shown.black),
        ("white", shown.white),
        *((stripe.name, picture) for stripe, picture in zip(shown.stripes, shown.pictures, strict=True)),
    ]:
        # 0.25 and 2.25 as the codes 0 and 188, whose linear value is 0.5029.
        files.write(tmp_path / f"{name}.png", Photograph(np.where(picture > 1, 188, 0).astype(np.uint8)))
    with pytest.warns(UserWarning, match="taken as sRGB"):
        read = read_patterns(tmp_path)
    assert np.allclose(np.unique(read.pictures), [0, 0.5029], atol=1e-4)
