"""The report of a measurement: every section a bracket has, with the measurement's own numbers and sound pictures."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from html import unescape
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from moving_scenes import known_response
from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.result import ClippingReport, MergedCamera, MergeResult
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import NOTHING_TO_DO, BracketDoubt
from relume.capture.lens.vignetting import Vignetting
from relume.capture.noise import Noise
from relume.capture.response.calibration import Calibration
from relume.capture.scale.absolute import Scale
from relume.capture.scale.readings import ChannelGains
from relume.errors import OutputNotWritten
from relume.image.colour import luminance
from relume.image.photograph import Exposure
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.report import capture_plots
from relume.report.capture_report import clipped_facts, percent, seconds_in_words, write_capture_report
from shoots import MAKER, exposed, raw_files, textured

SECONDS = (1 / 256, 1 / 128, 1 / 64, 1 / 32, 1 / 16, 1 / 8)


@pytest.fixture(scope="module")
def eventful() -> MergeResult:
    """A bracket that has everything: one frame reported wrong, one shifted, a thing that moved, a lamp, a border."""
    scene = 16 * textured(240, 160)
    scene[20:30, 200:215] = 50_000.0
    photographs = list(exposed(scene, [Exposure(t, 4.0, 100.0, "EXIF") for t in SECONDS]))
    photographs[1] = replace(photographs[1], pixels=np.roll(photographs[1].pixels, 4, axis=1))
    outside = np.zeros((160, 240), bool)
    outside[150:] = True
    for index, photograph in enumerate(photographs):
        photograph.pixels[90:130, 30 + 20 * index : 48 + 20 * index] = 90 + 15 * index
        photographs[index] = replace(photograph, outside=outside, focal_length=300.0)
    wrong = photographs[4].exposure
    assert wrong is not None
    photographs[4] = replace(photographs[4], exposure=replace(wrong, seconds=wrong.seconds * 1.3))
    found = merge_brackets(Bracket(tuple(photographs)), settings=MergeSettings(refine=True))
    doubts = (
        BracketDoubt("frame_9.png", "is <strange>", "leave it out", True),
        BracketDoubt("frame_8.png", "is late", "wait", False),
        BracketDoubt("all", "not in order", NOTHING_TO_DO, False),
    )
    one = replace(found.brackets[0], doubts=doubts)
    return replace(found, brackets=(one,), messages=("the wall is uneven",))


@pytest.fixture(scope="module")
def plain() -> MergeResult:
    """One in which nothing moved and nothing is amiss."""
    bracket = Bracket(exposed(textured(), [Exposure(t) for t in SECONDS]))
    return merge_brackets(bracket, profile=known_response(), settings=MergeSettings(align=True))


@pytest.fixture(scope="module")
def eventful_page(eventful, tmp_path_factory) -> str:
    return report(eventful, tmp_path_factory.mktemp("report"))


def _calibrated(result: MergeResult, calibration: Calibration) -> dict[str, MergedCamera]:
    return {MAKER: replace(result.camera, calibration=calibration)}


def report(result: MergeResult, folder: Path) -> str:
    path = folder / "report.html"
    write_capture_report(result, path)
    return path.read_text()


def headings(text: str) -> list[str]:
    return [unescape(words) for words in re.findall(r"<h2>(.*?)</h2>", text)]


def notes(text: str) -> list[str]:
    return [unescape(words) for words in re.findall(r'<p class="note">(.*?)</p>', text)]


def rows(text: str) -> list[list[str]]:
    """The cells of every row of every table, those of the heads too."""
    found = re.findall(r"<tr>(.*?)</tr>", text)
    return [[unescape(cell) for cell in re.findall(r"<t[dh]>(.*?)</t[dh]>", row)] for row in found]


def pictures(text: str) -> list[np.ndarray]:
    found = re.findall(r'src="data:image/png;base64,([^"]*)"', text)
    return [decoded(base64.b64decode(data, validate=True)) for data in found]


def decoded(image: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(image), formats=["PNG"]) as picture:
        return np.array(picture.convert("RGB"))


def test_a_bracket_that_has_everything_shows_everything(eventful_page):
    text = eventful_page
    assert headings(text) == [
        "frame_0.png … frame_5.png", "Exposures", "What no photograph measured", "How sure it is", "Alignment",
        "Ghosts", "The camera's response", "Timings",
    ]  # fmt: skip
    assert notes(text) == [
        "frame_9.png: is <strange>; leave it out", "the wall is uneven", "frame_8.png: is late; wait",
        f"all: not in order; {NOTHING_TO_DO}",
    ]  # fmt: skip
    # Three exposures, false colour, what was clipped, noise, arrows, ghosts, response.
    shown = pictures(text)
    assert len(shown) == 9
    for picture in shown:
        height, width = picture.shape[:2]
        assert 100 <= width <= 1400 and 60 <= height <= 1400
        assert picture.std() > 3, "the picture is empty"
    assert len(text) < 4_000_000
    assert "http:" not in text and "https:" not in text


def test_the_tables_hold_the_measurement_s_numbers(eventful, eventful_page):
    text, one = eventful_page, eventful.brackets[0]
    table = {row[0]: row for row in rows(text)}
    assert table["photograph"] == [
        "photograph", "time used", "aperture", "ISO", "stops", "source", "corrected by", "moved by", "ghosts",
    ]  # fmt: skip
    assert eventful.camera.calibration is not None and eventful.camera.calibration.ratios is not None
    ratios, aligned, deghosted = eventful.camera.calibration.ratios, one.aligned, one.deghosted
    assert aligned is not None and deghosted is not None
    for index, frame in enumerate(one.frames):
        row = table[frame.name]
        assert row[1:5] == [seconds_in_words(frame.seconds), "f/4", "100", f"{frame.stops:+.2f}"]
        assert row[5] == frame.source
        motion = next(
            m for p, m in zip(aligned.bracket.photographs, aligned.motions, strict=True) if p.name == frame.name
        )
        assert row[7] == f"{motion.dx:+.2f}, {motion.dy:+.2f} px, {np.degrees(motion.angle):+.3f}°"
        assert row[8] == f"{100 * deghosted.shares[index]:.2g} %"
    place = ratios.names[0].index("frame_4.png")
    correction, error = ratios.corrections[0][place], ratios.errors[0][place]
    assert table["frame_4.png"][6] == f"{correction / np.log(2):+.3f} ± {error / np.log(2):.3f}"
    assert correction == pytest.approx(-np.log(1.3), abs=0.03)
    assert one.corrections["frame_4.png"] == pytest.approx((correction / np.log(2), error / np.log(2)))
    assert list(one.corrections) == ["frame_4.png"]
    assert table["frame_2.png"][6] == "–"
    assert float(table["frame_1.png"][7].split(",")[0]) == pytest.approx(4, abs=0.25)
    for step, seconds in eventful.seconds.items():
        assert table[step] == [step, f"{seconds:.2f} s"]
    for words, value in clipped_facts(one.clipping, "relative"):
        assert table[words] == [words, value]
    residual = ", ".join(f"{r:.3f}" for r in eventful.camera.calibration.residual)
    assert f"Misfit of ln exposure {residual}" in text
    assert f"{one.clipping.orders:.1f} orders of magnitude" in text
    assert f"{100 * deghosted.ghosts.mean():.2g} % of the picture" in text


def test_the_arrows_are_those_of_the_frames_that_were_moved(eventful, tmp_path, monkeypatch):
    drawn = []
    arrows = capture_plots.arrows
    monkeypatch.setattr(
        capture_plots, "arrows", lambda radiance, fields: (drawn.extend(fields), arrows(radiance, fields))[1]
    )
    report(eventful, tmp_path)
    ((name, field),) = drawn
    assert name == "frame_1.png" and field.shape == (6, 8, 2)
    assert field[..., 0] == pytest.approx(4, abs=0.25) and field[..., 1] == pytest.approx(0, abs=0.25)


def test_a_quiet_bracket_says_so(plain, tmp_path):
    text = report(plain, tmp_path)
    assert headings(text)[-3:] == ["Alignment", "Ghosts", "Timings"] and "The camera's response" not in headings(text)
    assert notes(text) == []
    assert "All photographs lay on one another; none was moved." in text
    assert "Nothing moved; nothing was left out." in text
    assert "Nothing: every pixel was measured by at least one photograph." in text
    assert len(pictures(text)) == 5
    table = {row[0]: row for row in rows(text)}
    assert table["frame_3.png"] == [
        "frame_3.png", "1/32 s", "–", "–", "+3.00", "given", "–", "+0.00, +0.00 px, +0.000°", "0 %",
    ]  # fmt: skip


def test_what_was_switched_off_has_no_section(plain, tmp_path):
    picture = replace(plain.brackets[0].picture, variance=None)
    one = replace(plain.brackets[0], aligned=None, deghosted=None, picture=picture)
    text = report(replace(plain, brackets=(one,)), tmp_path)
    assert headings(text)[1:] == ["Exposures", "What no photograph measured", "Timings"]
    assert {row[0]: row for row in rows(text)}["frame_3.png"][6:] == ["–", "–", "–"]


def test_camera_raws_are_reported_without_a_response(tmp_path):
    light = textured(240, 160).mean(2) / 8
    found = merge_brackets(raw_files(tmp_path / "raws", [light] * 3, (0.25, 1.0, 4.0)))
    text = report(found, tmp_path)
    assert headings(text)[1:] == ["Exposures", "What no photograph measured", "How sure it is", "Timings"]
    assert found.brackets[0].clipping.saturated > 0
    frames, table = found.brackets[0].frames, {row[0]: row for row in rows(text)}
    assert table["response"][1] == "none needed: camera raws are linear"
    assert table["switched off"][1] == "alignment and deghosting: camera raws are merged as they lie"
    for name, frame in zip(("raw_0.dng", "raw_1.dng", "raw_2.dng"), frames, strict=True):
        assert table[name][1:4] == [seconds_in_words(frame.seconds), "f/4", "100"]
        stops, error = found.brackets[0].corrections[frame.name]
        assert table[name][6] == f"{stops:+.3f} ± {error:.3f}" and 0 < abs(stops) < 0.01
    assert len(pictures(text)) == 6


def test_each_camera_has_its_own_part(plain, eventful, tmp_path):
    other = replace(plain.brackets[0], camera="Other Two")
    both = replace(
        eventful,
        brackets=(*eventful.brackets, other),
        cameras={MAKER: eventful.camera, "Other Two": replace(plain.camera, name="Other Two")},
    )
    text = report(both, tmp_path)
    assert text.count("<td>Other Two</td>") == 1 and headings(text).count("The camera's response") == 1
    with pytest.raises(OutputNotWritten):
        write_capture_report(plain, tmp_path / "nowhere" / "report.html")


def test_a_photograph_alone_is_reported(tmp_path):
    alone = Bracket(exposed(textured(), [Exposure(0.01)]))
    found = merge_brackets(
        alone, profile=known_response(), settings=MergeSettings(balance=lambda _: ChannelGains((1.0, 1.0, 2.0)))
    )
    assert not {"Alignment", "Ghosts"} & set(headings(report(found, tmp_path)))


def test_noise_that_was_measured_is_reported(eventful, tmp_path):
    noise = Noise(np.array([1e-4, 2e-4, 3e-4]), np.array([0.01, 0.02, 0.03]))
    changed = replace(
        eventful, brackets=(), cameras=_calibrated(eventful, replace(eventful.camera.calibration, noise=noise))
    )
    words = "shot noise (0.0001, 0.0002, 0.0003), read noise (0.01, 0.02, 0.03) of the exposure at white"
    assert words in report(changed, tmp_path)
    silent = replace(
        eventful, brackets=(), cameras=_calibrated(eventful, replace(eventful.camera.calibration, noise=None))
    )
    assert "shot noise" not in report(silent, tmp_path)


def test_what_was_clipped_is_reported_with_its_bounds_and_no_more():
    found = ClippingReport(12, 3, 7, 1000, 0.0123, 456.0, (1.0, 2.0, 3.0), 0.25, 4.0)
    assert clipped_facts(found, "cd/m²") == [
        ("saturated in every photograph", "12 of 1000 pixels"),
        ("their solid angle", "0.0123 sr"),
        ("irradiance they bring at least", "(1, 2, 3) cd/m²·sr"),
        ("their luminance reaches at least", "456 cd/m²"),
        ("their share of all light in the picture", "at least 25 %"),
        ("black in every photograph", "3 pixels"),
        ("outside every photograph", "7 pixels"),
    ]
    unknown = clipped_facts(replace(found, solid_angle=None, irradiance=None), "relative")
    assert unknown[1:3] == [
        ("their solid angle", "not known without a focal length in pixels, --focal-length"),
        ("their luminance reaches at least", "456 relative units"),
    ]
    assert clipped_facts(replace(found, saturated=0, black=0, outside=0), "relative") == []
    assert clipped_facts(replace(found, saturated=0, black=1, outside=0), "relative")[0][1] == "1 pixel"


@pytest.mark.parametrize(
    "seconds, words",
    [
        (1 / 8000, "1/8000 s"),
        (1 / 60, "1/60 s"),
        (0.25, "1/4 s"),
        (1 / 20000, "1/20000 s"),
        (0.3, "0.3 s"),
        (0.4, "0.4 s"),
        (15.0, "15 s"),
    ],
)
def test_times_are_said_as_photographers_say_them(seconds, words):
    assert seconds_in_words(seconds) == words


def steps(width: int = 400, height: int = 120) -> RadianceMap:
    """Grey from 0.01 at the left to 1000 at the right, evenly in its logarithm."""
    light = np.geomspace(1e-2, 1e3, width, dtype=np.float32)
    radiance = np.broadcast_to(light[None, :, None], (height, width, 3)).copy()
    return RadianceMap(radiance, (0.1 * radiance) ** 2, np.zeros((height, width), np.uint8))


@pytest.fixture
def drawn(monkeypatch) -> list[Figure]:
    """The figures that a test's drawings are made of."""
    found: list[Figure] = []
    encoded = capture_plots.encoded_figure
    monkeypatch.setattr(capture_plots, "encoded_figure", lambda figure: (found.append(figure), encoded(figure))[1])
    return found


def test_false_colour_is_a_scale_of_the_logarithm(drawn):
    """Equal ratios of luminance are equal steps along the colours, from the darkest to the brightest."""
    from matplotlib import colormaps

    picture = steps()
    shown = decoded(capture_plots.false_colour(replace(picture, unit="cd/m²")))
    (figure,) = drawn
    axis, scale = figure.axes
    image = axis.images[0]
    low, high = image.get_clim()
    assert high == pytest.approx(1000, rel=1e-6) and low == pytest.approx(0.01, rel=0.02)
    assert scale.get_ylabel() == "luminance, cd/m²"
    np.testing.assert_allclose(np.array(image.get_array()), np.maximum(luminance(picture.radiance), low), rtol=1e-6)
    # What the page shows: a quarter, a half and three quarters of the way the colours of those shares.
    ends = axis.get_window_extent()
    row = shown.shape[0] - round((ends.y0 + ends.y1) / 2)
    for share in (0.25, 0.5, 0.75):
        colour = shown[row, round(ends.x0 + share * ends.width)]
        assert colour / 255 == pytest.approx(colormaps["turbo"](share)[:3], abs=0.03)


def test_the_relative_error_is_that_of_the_variance(drawn):
    picture = steps()
    assert picture.variance is not None
    picture.variance[:, :100] = np.inf
    capture_plots.relative_error(picture)
    left, right = drawn[0].axes[:2]
    drawn_errors = left.images[0].get_array()
    assert isinstance(drawn_errors, np.ma.MaskedArray)
    shown = drawn_errors.filled(np.nan)
    assert np.isnan(shown[:, :100]).all()
    np.testing.assert_allclose(shown[:, 100:], 10, rtol=1e-5)
    for line in right.lines:
        medians = np.asarray(line.get_ydata(), np.float64)
        assert medians[np.isfinite(medians)] == pytest.approx(10, rel=1e-3)
    assert len(right.lines) == 3


def test_the_scale_of_the_relative_error_fits_the_picture(drawn):
    picture = steps()
    errors = np.geomspace(0.02, 0.06, 400)
    errors[0] = 5.0  # one column is far off and does not stretch the scale
    variance = ((errors[None, :, None] * picture.radiance) ** 2).astype(np.float32)
    capture_plots.relative_error(replace(picture, variance=variance))
    assert drawn[0].axes[0].images[0].get_clim() == pytest.approx((2.02, 5.97), rel=0.01)


def test_what_a_bracket_is_is_reported_at_its_top(eventful, eventful_page, plain, tmp_path):
    table = {row[0]: row[1:] for row in rows(report(replace(eventful, seconds={}), tmp_path))}
    assert table["camera"] == [MAKER] and table["photographs"] == ["6 of 240 × 160 pixels"]
    assert table["unit"] == ["relative units"] and table["scale"] == ["none; radiance is relative"]
    assert table["balance"] == ["the camera's own"] and table["response"] == ["recovered from 1 bracket"]
    assert table["switched off"] == ["nothing"] and table["left in, for not measured"] == ["vignetting, glare"]
    clipped = eventful.brackets[0].picture.clipped
    saturated, outside = (100 * float((clipped == mark).mean()) for mark in (SATURATED, OUTSIDE))
    assert saturated > 0 and outside == pytest.approx(6.25)
    words = f"saturated {saturated:.2g} %, black 0 %, outside {outside:.2g} %"
    assert table["measured by no photograph"] == [words]
    assert f"a lower bound ({saturated:.2g} %)" in eventful_page
    assert "relative units is white" in eventful_page

    scale = Scale.grey(7.0, 0.05, "a lux reading")
    one = replace(plain.brackets[0], scale=scale, balance=ChannelGains((1.0, 1.0, 2.0)))
    off = MergeSettings(align=False, deghost=False, vignetting=(Vignetting((-0.3,)),))
    path = tmp_path / "off.html"
    unnamed = replace(plain, brackets=(replace(one, camera=""),), cameras={"": replace(plain.camera, name="")})
    write_capture_report(unnamed, path, settings=off, profile="known.json")
    table = {row[0]: row[1:] for row in rows(path.read_text())}
    assert table["camera"] == ["unknown"] and table["response"] == ["given by known.json"]
    assert table["scale"] == ["7 cd/m² ± 5 % per relative unit, from a lux reading"]
    assert table["balance"] == ["channels multiplied by (1, 1, 2)"]
    assert table["switched off"] == ["alignment, deghosting"] and table["left in, for not measured"] == ["glare"]


@pytest.mark.parametrize("part, words", [(0, "0 %"), (1, "below 0.01 %"), (10, "0.01 %"), (25_000, "25 %")])
def test_few_pixels_are_not_reported_as_none(part, words):
    assert percent(part, 100_000) == words


def test_small_and_empty_pictures_are_drawn_without_a_word():
    """Of a handful of pixels too, and of one where nothing was measured."""
    tiny = steps(8, 6)
    for picture in (tiny, replace(tiny, radiance=np.zeros_like(tiny.radiance), variance=np.full((6, 8, 3), np.inf))):
        assert decoded(capture_plots.false_colour(picture)).size and decoded(capture_plots.relative_error(picture)).size
        assert decoded(capture_plots.marked(picture.radiance, [])).size


def test_what_was_clipped_is_marked_in_its_colour():
    picture = steps()
    assert picture.clipped is not None
    for top, mark in ((10, SATURATED), (30, BLACK), (50, OUTSIDE)):
        picture.clipped[top : top + 10, 10:20] = mark
    shown = decoded(capture_plots.clipped_marks(picture)).astype(int)
    assert shown.shape == (120, 400, 3)
    for row, channel in ((15, 0), (35, 2), (55, 1)):
        mark, beside = shown[row, 15], shown[row, 25]
        assert mark.argmax() == channel and mark[channel] - np.sort(mark)[1] > 60
        assert np.ptp(beside) <= 1


def test_one_clipped_pixel_of_a_large_picture_is_seen():
    picture = steps(2600, 300)
    assert picture.clipped is not None
    picture.clipped[150, 1300] = SATURATED
    shown = decoded(capture_plots.clipped_marks(picture)).astype(int)
    assert shown.shape[1] <= 1024
    assert (shown[..., 0] - shown[..., 2] > 60).sum() == 1


def test_arrows_point_to_where_a_photograph_shows_the_point(drawn):
    from matplotlib.quiver import Quiver

    field = np.zeros((2, 3, 2))
    field[..., 0], field[..., 1] = 2.0, -1.0
    image = decoded(capture_plots.arrows(steps().radiance, [("a.jpg", field), ("b.jpg", -0.5 * field)]))
    assert image.shape[1] > 500
    first, second = drawn[0].axes
    assert first.get_title() == "a.jpg\nup to 2.24 px" and drawn[0].get_suptitle() == "arrows drawn × 17.9"
    (arrows,) = [child for child in first.get_children() if isinstance(child, Quiver)]
    assert (np.asarray(arrows.U) / np.asarray(arrows.V)).ravel() == pytest.approx(np.full(6, -2.0))
    assert np.asarray(arrows.U).ravel() == pytest.approx(np.full(6, 0.1 * 400 / np.hypot(2, 1) * 2))
    assert np.asarray(arrows.X).ravel() == pytest.approx([400 / 6, 200, 2000 / 6] * 2) and arrows.angles == "xy"
    # The picture's axis runs down, as y does.
    assert first.get_ylim() == (120, 0) and second.get_title() == "b.jpg\nup to 1.12 px"
    # All arrows are enlarged alike.
    (shorter,) = [child for child in second.get_children() if isinstance(child, Quiver)]
    assert np.asarray(shorter.U) == pytest.approx(-0.5 * np.asarray(arrows.U))


def test_titles_over_arrows_do_not_overprint(drawn):
    names = [f"a_hand_held_bracket_of_the_street_at_noon_{i:04}.jpg" for i in range(8)]
    capture_plots.arrows(steps(200, 300).radiance, [(name, np.ones((6, 8, 2))) for name in names])
    boxes = [axis.title.get_window_extent() for axis in drawn[0].axes[:8]]
    for row in (boxes[:5], boxes[5:]):
        assert all(left.x1 < right.x0 for left, right in pairwise(row))
    assert all(f"{i:04}.jpg" in axis.get_title() for i, axis in enumerate(drawn[0].axes[:8]))
