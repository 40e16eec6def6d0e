"""Each kind of doubtful bracket is reported by its own words, and a sound one by none."""

import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.exposure.comparison import (
    STRANGE,
    brightness_chain,
    log_ratio,
    matched,
    reduced,
    similarity,
    structure,
)
from relume.capture.exposure.consistency import BracketDoubt, check
from relume.capture.exposure.folder import expand
from relume.capture.exposure.overexposed import darkest_alike, share_shown
from relume.capture.exposure.validation import compare
from relume.errors import NotABracket
from relume.image.photograph import Exposure, Photograph, Settings
from relume.image.response import Response
from shoots import real_bracket
from synthetic import NOISELESS, NOISY, VirtualCamera, wide_scene


def camera(toe: float, power: float, knee: float) -> VirtualCamera:
    """A camera of one curve in all channels, with noise."""
    return VirtualCamera((toe, toe, toe), (power, power, power), (knee, knee, knee), electrons=20_000.0, read_noise=8.0)


SOFT, HARD, PLAIN = camera(0.0005, 1.8, 5.0), camera(0.01, 2.4, 0.5), camera(1e-5, 2.2, 1e5)
CAMERAS = {"knee": NOISY, "noiseless": NOISELESS, "soft": SOFT, "hard": HARD, "plain": PLAIN}
SEVEN = tuple(0.25 * 2.0**-k for k in range(7))
THREE = (1 / 256, 1 / 64, 1 / 16)


def textured(seed: int = 3, width: int = 360, height: int = 240) -> np.ndarray:
    """A wide scene with things in it: patches of all sizes, each lighter or darker than its surroundings."""
    scene = wide_scene(width, height, stops=9.0)
    generator = np.random.default_rng(seed)
    for _ in range(120):
        y, x = generator.integers(0, height), generator.integers(0, width)
        h, w = generator.integers(4, 60, 2)
        scene[y : y + h, x : x + w] *= generator.uniform(0.3, 2.0) * generator.uniform(0.8, 1.2, 3).astype(np.float32)
    return scene


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    return textured_once()


@cache
def textured_once() -> np.ndarray:
    return textured()


@cache
def taken(camera: str, times: tuple[float, ...]) -> Bracket:
    """The scene photographed by one of the cameras; no test may write to its pixels."""
    return CAMERAS[camera].bracket(textured_once(), times)


@pytest.fixture(scope="module")
def sound() -> Bracket:
    return taken("knee", SEVEN)


def misreported(bracket: Bracket, **stops: float) -> Bracket:
    """The bracket with the exposures of some frames reported wrong by so many stops; frame_3=1 says twice the time."""
    names = {f"{name}.jpg": 2.0**off for name, off in stops.items()}
    return Bracket(
        tuple(
            replace(p, exposure=replace(p.exposure, seconds=p.exposure.seconds * names.get(p.name, 1.0), source="EXIF"))
            for p in bracket.photographs
            if p.exposure
        )
    )


def changed(bracket: Bracket, place: int, **fields) -> Bracket:
    """The bracket with fields of one photograph replaced."""
    photographs = list(bracket.photographs)
    photographs[place] = replace(photographs[place], **fields)
    return Bracket(tuple(photographs))


def only(bracket: Bracket, *words: str, degraded: bool = True, response: Response | None = None) -> BracketDoubt:
    """The one doubt about the bracket, besides the order of its files where that is not meant; it holds the words."""
    doubts = check(bracket, response)
    if degraded:
        doubts = [doubt for doubt in doubts if "sorted by exposure" not in doubt.what]
    assert len(doubts) == 1, [doubt.line for doubt in doubts]
    (doubt,) = doubts
    assert "\n" not in doubt.line and doubt.degraded == degraded
    for word in words:
        assert word in doubt.line, doubt.line
    return doubt


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("times", [SEVEN, THREE, SEVEN[2:4]], ids=["seven", "three", "two"])
def test_a_sound_bracket_raises_no_doubt(camera, times):
    assert check(taken(camera, times)) == ()


@pytest.mark.parametrize(
    "name",
    ["arch_full", "garage", "ghost_hall", "handheld_street", "memorial", "room", "window", "ghost_sculpture_garden"],
)
def test_real_brackets_raise_no_doubt_that_degrades(shared, name):
    doubts = check(real_bracket(shared, name))
    assert not any(doubt.degraded for doubt in doubts), [doubt.line for doubt in doubts]
    said_so = [doubt for doubt in doubts if "sorted by exposure" not in doubt.what]
    if name == "arch_full":
        # Its white balance was automatic, and the longest photograph is bluer by half a stop.
        assert [doubt.frame[-10:] for doubt in said_so] == ["img_15.jpg"]
        assert "by its automatic white balance: blue against red by 0.5 stops" in said_so[0].what
    else:
        assert said_so == []


def test_virtual_shoots_raise_no_doubt(shared):
    for name in ("plate", "plate_handheld", "ball_0", "ball_90"):
        assert check(read_bracket(expand([shared / "shoots/room" / name]))) == ()


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("frame, off", [(1, 1 / 3), (4, -1 / 3)])
def test_a_third_of_a_stop_is_found(camera, frame, off):
    bracket = misreported(taken(camera, SEVEN), **{f"frame_{frame}": off})
    direction = "less" if off > 0 else "more"
    doubt = only(bracket, "by its EXIF, it shows about a third of a stop", f"{direction} light", "with --refine")
    assert doubt.frame == f"frame_{frame}.jpg"


def stops_in(doubt: BracketDoubt) -> float:
    found = re.search(r"wrong by ([\d.]+) stops", doubt.what)
    assert found is not None, doubt.what
    return float(found[1])


@pytest.mark.parametrize("frame, off", [(0, 10.0), (2, -10.0), (6, 2.0)])
def test_many_stops_are_distinguished_from_a_third(sound, frame, off):
    doubt = only(misreported(sound, **{f"frame_{frame}": off}), "its EXIF seems wrong by", "give the right times")
    assert stops_in(doubt) == pytest.approx(abs(off), rel=0.06)
    assert doubt.frame == f"frame_{frame}.jpg"
    assert ("that much less light" if off > 0 else "that much more light") in doubt.what


def test_two_wrong_times_are_both_found(sound):
    doubts = [doubt for doubt in check(misreported(sound, frame_1=1 / 3, frame_4=-10.0)) if doubt.degraded]
    assert {doubt.frame: "third" in doubt.what for doubt in doubts} == {"frame_1.jpg": True, "frame_4.jpg": False}


@pytest.mark.parametrize("frame", [0, 1, 2])
def test_of_three_photographs_the_one_wrong_by_ten_stops_is_found(frame):
    bracket = misreported(taken("soft", THREE), **{f"frame_{frame}": 10.0})
    doubt = only(bracket, "its EXIF seems wrong by")
    assert doubt.frame == f"frame_{frame}.jpg" and 9 <= stops_in(doubt) <= 11


def test_a_known_response_shows_a_third_of_a_stop_even_between_two(scene):
    bracket = NOISY.bracket(scene, (1 / 64, 1 / 16))
    curve = NOISY.log_exposure()
    curve[:, 0] = curve[:, 1] - 1.0
    response = Response(curve, np.full(3, 0.5))
    assert check(bracket, response) == ()
    assert check(misreported(bracket, frame_0=1 / 3)) == ()  # any such ratio fits some curve
    only(misreported(bracket, frame_0=1 / 3), "about a third of a stop", response=response)


def test_the_same_time_for_all_is_no_time(sound):
    same = Bracket(tuple(replace(p, exposure=Exposure(1 / 20, source="EXIF")) for p in sound.photographs))
    doubt = only(same, "all have 1/20 s by its EXIF", "stops", "give the exposure times with --times")
    assert doubt.frame == same.name


def test_the_trap_of_a_real_set(shared):
    bracket = real_bracket(shared, "ghost_sculpture_garden", sidecars=False)
    only(bracket, "all have 1/20 s by its EXIF", "5.", "--times")


def test_photographs_of_one_exposure_and_one_brightness_are_no_trap(scene):
    assert check(NOISY.bracket(scene, (1 / 64, 1 / 64, 1 / 64))) == ()


@pytest.mark.parametrize("order", [(6, 5, 4, 3, 2, 1, 0), (1, 0, 2, 3, 5, 4, 6)], ids=["reciprocals", "swapped"])
def test_times_in_another_order_than_the_photographs(sound, order):
    times = [p.exposure for p in sound.photographs]
    bracket = Bracket(tuple(replace(p, exposure=times[i]) for p, i in zip(sound.photographs, order, strict=True)))
    doubts = [doubt for doubt in check(bracket) if doubt.degraded]
    assert len(doubts) == 1 and doubts[0].frame == bracket.name
    assert "in another order than the photographs' brightness" in doubts[0].what
    assert "1/30, not 30" in doubts[0].remedy
    exposures = [(p.name, p.exposure) for p in bracket.photographs]
    pairs = [f"{name} 1/{1 / each.seconds:.4g} s" for name, each in exposures if each is not None]
    assert sum(pair in doubts[0].what for pair in pairs) == 5 and doubts[0].what.endswith(", …)")


def test_a_photograph_of_another_scene_is_found_wherever_it_stands(scene, sound):
    strange = textured(seed=8)[::-1, ::-1]
    for place in (0, 3, 6):
        photograph = sound.photographs[place]
        assert photograph.exposure is not None
        wrong = NOISY.photograph(strange, photograph.exposure).pixels
        doubt = only(changed(sound, place, pixels=wrong), "not to be of the scene that the others show", "leave it out")
        assert doubt.frame == photograph.name and doubt.effect == 0.5
    two = Bracket((sound.photographs[2], NOISY.photograph(strange, Exposure(SEVEN[3]))))
    only(two, "these photographs do not show one scene")


def paving(seed: int) -> np.ndarray:
    """Stones of like brightness, and four dark holes in them: a long exposure shows the holes alone."""
    generator = np.random.default_rng(seed)
    stones = 0.5 * generator.uniform(0.5, 1.3, (12, 18, 1)).astype(np.float32)
    scene = stones.repeat(20, axis=0).repeat(20, axis=1).repeat(3, axis=2)
    for _ in range(4):
        y, x = generator.integers(20, 190), generator.integers(20, 310)
        scene[y : y + 22, x : x + 22] *= 0.04
    return scene


def of_another_scene(bracket: Bracket) -> list[BracketDoubt]:
    return [doubt for doubt in check(bracket) if "not to be of the scene" in doubt.what or "one scene" in doubt.what]


def test_a_photograph_that_is_white_nearly_everywhere_is_judged_by_what_it_shows():
    """Its white hides what the others show, so few ranks agree however right it is."""
    times = (0.5, 1, 2, 8)
    right = NOISY.bracket(paving(1), times)
    darker, last = (reduced(photograph) for photograph in right.photographs[-2:])
    assert 0.03 < share_shown(last) < 0.1
    assert (similarity(structure(darker), structure(last)) or 0.0) < STRANGE
    assert (darkest_alike(darker, last) or 0.0) > 0.9
    assert of_another_scene(right) == []
    # Only what it shows is merged, and no more can be wrong.
    for seed in range(2, 6):
        wrong = changed(right, 3, pixels=NOISY.photograph(paving(seed), Exposure(8)).pixels)
        (doubt,) = of_another_scene(wrong)
        assert doubt.frame == right.photographs[3].name
        assert doubt.effect == pytest.approx(0.06, abs=0.03) and not doubt.ranked.wrong


def test_nothing_is_said_of_a_photograph_that_shows_next_to_nothing():
    scene = paving(1)
    scene[scene < 0.1] = 0.5
    scene[100:112, 100:112] = 0.02
    bracket = NOISY.bracket(scene, (0.5, 1, 2, 8))
    assert 0 < share_shown(reduced(bracket.photographs[3])) < 0.01
    assert of_another_scene(bracket) == []
    assert of_another_scene(changed(bracket, 3, pixels=np.full_like(bracket.photographs[3].pixels, 255))) == []


def test_real_photographs_of_other_scenes_are_strange_and_those_of_one_scene_are_not(shared):
    def structures(name: str) -> list:
        photographs = real_bracket(shared, name).photographs
        return [structure(reduced(replace(p, pixels=p.pixels[:590, :890]))) for p in photographs]

    hall, garage = structures("ghost_hall"), structures("garage")
    alike = [similarity(a, b) for of in (hall, garage) for a, b in pairwise(of)]
    strange = [similarity(a, b) for a in hall for b in garage]
    assert min(a for a in alike if a is not None) > 0.8 > STRANGE > 0.3 > max(a for a in strange if a is not None)


def test_a_moved_camera_is_no_other_scene():
    wide = textured(width=400, height=260)
    frames = []
    for i, (seconds, shift) in enumerate(zip(SEVEN[1:4], ((0, 0), (9, 12), (14, 2)), strict=True)):
        moved = wide[shift[0] : shift[0] + 240, shift[1] : shift[1] + 360]
        frames.append(NOISY.photograph(moved, Exposure(seconds), name=f"frame_{i}.jpg", seed=i))
    assert [doubt for doubt in check(Bracket(tuple(frames))) if doubt.degraded] == []


def automatic(bracket: Bracket, value: bool | None) -> Bracket:
    return Bracket(tuple(replace(p, settings=Settings(automatic_white=value)) for p in bracket.photographs))


@pytest.mark.parametrize(
    "automatically, gain, degraded", [(True, 1.45, False), (True, 2.0, True), (False, 1.45, None), (None, 2.0, True)]
)
def test_a_white_balance_that_changed_is_reported_where_the_camera_was_free_to(scene, automatically, gain, degraded):
    frames = list(taken("soft", SEVEN[1:6]).photographs)
    for i in (3, 4):
        exposure = frames[i].exposure
        assert exposure is not None
        warmer = SOFT.photograph(scene * np.array([gain**0.5, 1.0, gain**-0.5]), exposure, seed=i)
        frames[i] = replace(warmer, name=frames[i].name)
    bracket = automatic(Bracket(tuple(frames)), automatically)
    if degraded is None:
        assert check(bracket) == ()
        return
    doubt = only(bracket, "red against blue by", "fixed white balance", degraded=degraded)
    assert doubt.frame == frames[3].name
    assert ("automatic" in doubt.what) == bool(automatically)
    steady = taken("soft", SEVEN[1:6])
    assert check(automatic(steady, automatically)) == ()


def test_copies_are_reported(sound):
    twin = replace(sound.photographs[2], name="frame_9.jpg")
    only(Bracket((*sound.photographs, twin)), "frame_9.jpg: pixel for pixel frame_4.jpg", "take one of them out")
    exposure = sound.photographs[3].exposure
    assert exposure is not None
    other = replace(twin, exposure=replace(exposure, seconds=exposure.seconds * 1.2))
    lines = [doubt.line for doubt in check(Bracket((*sound.photographs, other)))]
    assert any("pixel for pixel frame_4.jpg, yet given 1/27 s and not 1/64 s" in line for line in lines)


def test_black_and_white_photographs_are_no_copies():
    black = tuple(Photograph(np.zeros((40, 60, 3), np.uint8), f"{i}.jpg", Exposure(2.0**i)) for i in range(3))
    assert not any("pixel for pixel" in doubt.what for doubt in check(Bracket(black)))


def test_too_few_grey_levels_are_reported(sound):
    coarse = Bracket(tuple(replace(p, pixels=p.pixels // 16 * 16) for p in sound.photographs))
    only(coarse, "too few grey levels to recover a response: a channel holds 16 of 256 values", "recovered before")
    deep = Bracket(tuple(replace(p, pixels=p.pixels // 16 * np.uint16(4096)) for p in sound.photographs))
    only(deep, "16 of 65536 values")
    assert check(Bracket(tuple(replace(p, pixels=p.pixels * np.uint16(257)) for p in sound.photographs))) == ()


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"camera": "Canon EOS 5D"}, "different cameras: Canon EOS 5D, Nikon D3"),
        ({"settings": Settings(serial="2")}, "different camera bodies: 1, 2"),
        ({"settings": Settings(serial="1", lens="50 mm")}, "different lenses: 35 mm, 50 mm"),
        ({"settings": Settings(serial="1", focal_length=50.0)}, "different focal lengths: 35 mm, 50 mm"),
    ],
)
def test_mixed_equipment_is_reported(sound, fields, words):
    settings = Settings(serial="1", lens="35 mm", focal_length=35.0)
    same = Bracket(tuple(replace(p, camera="Nikon D3", settings=settings) for p in sound.photographs))
    assert check(same) == ()
    only(changed(same, 2, **fields), words)
    # What one file does not say is no difference.
    assert check(changed(same, 2, camera="", settings=Settings())) == ()


def test_a_varied_aperture_and_iso_are_said_and_merged(scene):
    settings = [(1 / 64, 8.0, 100.0), (1 / 16, 8.0, 100.0), (1 / 16, 4.0, 100.0), (1 / 16, 4.0, 400.0)]
    bright = NOISELESS.bracket(scene * 64.0, [1.0]).photographs[0]
    frames = [
        replace(NOISELESS.photograph(scene * 64.0, Exposure(t, n, s)), name=f"{i}.jpg")
        for i, (t, n, s) in enumerate(settings)
    ]
    assert bright.exposure is not None
    lines = [(doubt.line, doubt.degraded) for doubt in check(Bracket(tuple(frames)))]
    assert [degraded for _, degraded in lines] == [False, True]
    assert "the aperture varies (f/4, f/8)" in lines[0][0] and "varying the aperture is not recommended" in lines[0][0]
    assert "the ISO varies (100, 400)" in lines[1][0] and "switch automatic ISO off" in lines[1][0]


def test_estimated_exposures_are_reported(sound):
    guessed = [replace(p, exposure=replace(p.exposure, source="estimated")) for p in sound.photographs if p.exposure]
    assert only(Bracket(tuple(guessed)), "it was estimated from the pixels", "--times").frame == sound.name
    named = [replace(p, name=f"cp_t{2**k}.jpg") for k, p in zip((9, 7, 5, 3, 2, 1, 0), guessed, strict=False)]
    only(Bracket(tuple(named)), "estimated from the pixels", "the names read 1/512, 1/128, ")
    one = Bracket((*sound.photographs[:3], guessed[3], *sound.photographs[4:]))
    assert only(one, "no exposure is known").frame == "frame_3.jpg"


def test_files_in_another_order_are_said_and_harm_nothing(sound):
    names = ("a.jpg", "c.jpg", "b.jpg")
    shuffled = Bracket(tuple(replace(p, name=n) for p, n in zip(sound.photographs[2:5], names, strict=True)))
    only(shuffled, "not named in the order of their exposures", "nothing need be done", degraded=False)


def test_a_border_marked_as_outside_counts_nowhere():
    frames = []
    for i, p in enumerate(taken("soft", SEVEN[1:6]).photographs):
        pixels, outside = p.pixels.copy(), np.zeros(p.pixels.shape[:2], bool)
        outside[:, : 90 - 10 * i] = True
        pixels[outside] = (0, 0, 255)
        frames.append(replace(p, pixels=pixels, outside=outside))
    assert check(Bracket(tuple(frames))) == ()
    all_outside = replace(frames[0], outside=np.ones(frames[0].pixels.shape[:2], bool))
    with pytest.raises(NotABracket, match=r"frame_4\.jpg: all of it is marked as outside"):
        check(Bracket((frames[1], replace(all_outside, name="frame_4.jpg"))))


# ---- what the verdicts rest on --------------------------------------------------------------------------------------


def test_matched_values_lie_on_the_cameras_curve(scene):
    dark, bright = (reduced(p) for p in NOISELESS.bracket(scene, (1 / 64, 1 / 16)).photographs)
    curve = NOISELESS.log_exposure()
    for channel, (a, b) in enumerate(matched(dark, bright)):
        assert len(a) > 20
        reported_ratio = np.interp(255 * b, range(256), curve[channel]) - np.interp(255 * a, range(256), curve[channel])
        assert np.median(np.abs(reported_ratio - np.log(4.0))) < 0.02


def test_the_ratio_of_srgb_photographs_is_exact_to_a_hundredth(scene):
    x = np.clip(scene / 8, 0, 1)

    def photograph(factor: float, most: int = 255) -> Photograph:
        light = np.clip(x * factor, 0, 1)
        value = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        return Photograph(np.rint(most * value).astype(np.uint8 if most == 255 else np.uint16), f"{factor}.png")

    ratios = [log_ratio(reduced(photograph(0.25, most)), reduced(photograph(1.0, most))) for most in (255, 65535)]
    assert ratios == pytest.approx([np.log(4)] * 2, abs=0.01)
    chain = brightness_chain([reduced(photograph(f)) for f in (1.0, 0.25, 4.0, 0.5)])
    assert chain == pytest.approx(np.log([4.0, 1.0, 16.0, 2.0]), abs=0.02)


def test_corrections_are_as_large_as_the_error(sound):
    order = sorted(sound.photographs, key=lambda p: p.exposure.factor if p.exposure else 0)
    exposures = np.log(sound.exposures)
    for off in (1 / 3, 1.0, 10.0):
        wrong = exposures.copy()
        wrong[3] += off * np.log(2)
        result = compare([reduced(p) for p in order], wrong)
        assert result.corrections[3] / np.log(2) == pytest.approx(-off, abs=0.05)
        assert np.abs(np.delete(result.corrections, 3)).max() / np.log(2) < 0.1


def test_photographs_are_made_small_alike_whatever_their_size(scene):
    photograph = NOISELESS.photograph(scene, Exposure(1 / 16))
    large = replace(photograph, pixels=np.repeat(np.repeat(photograph.pixels, 7, axis=0), 7, axis=1))
    small, made_small = reduced(photograph), reduced(large)
    assert small.encoded.shape == (240, 360, 3)
    assert 250 <= made_small.encoded.shape[1] <= 360
    assert made_small.mean == pytest.approx(small.mean, abs=0.005)
    assert made_small.encoded.mean() == pytest.approx(photograph.pixels.mean() / 255, abs=0.005)
    tiny = reduced(replace(photograph, pixels=photograph.pixels[:2, :3]))
    assert tiny.encoded.shape == (2, 3, 3)
    np.testing.assert_allclose(tiny.encoded, photograph.pixels[:2, :3] / 255, atol=1e-6)


def test_borders_of_one_pure_colour_are_reported_before_they_are_taken_for_wrong_times():
    """A registered scan's blue border looks black in one channel and white in another whatever the exposure."""
    frames = []
    for index, photograph in enumerate(taken("noiseless", SEVEN).photographs):
        pixels = photograph.pixels.copy()
        pixels[: 2 + index] = (0, 0, 255)
        frames.append(replace(photograph, pixels=pixels))
    doubt = only(Bracket(tuple(frames)), "exactly the colour 0,0,255", "with --ignore 0,0,255")
    assert doubt.degraded
    masked = tuple(replace(p, outside=np.all(p.pixels == (0, 0, 255), axis=2)) for p in frames)
    assert not check(Bracket(masked))
