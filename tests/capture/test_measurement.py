"""The steps from brackets to radiance: in order, each once, each left out when asked, and nothing they say lost."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from handheld import FINE, MARGIN, luminance, stack, unplaced
from moving_scenes import CAMERA, known_response, moving_scene
from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.one_camera import _warn_of_an_odd_frame
from relume.capture.brackets.result import MergeResult, clipping_report
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import NOTHING_TO_DO, BracketDoubt
from relume.capture.ghosts.deghosting import Deghosted
from relume.capture.lens.glare import Glare, diminish_glare
from relume.capture.lens.vignetting import Vignetting, corrected
from relume.capture.merging import Hat, merge
from relume.capture.response.calibration import DOUBTFUL_MISFIT
from relume.capture.scale.absolute import Scale, apply_scale, scale_from_spot
from relume.capture.scale.readings import ChannelGains, apply_balance
from relume.errors import NotABracket
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap
from shoots import MAKER, SECONDS, exposed, named, textured
from synthetic import NOISELESS, wide_scene

PLAIN = MergeSettings(refine=False, align=False, deghost=False)
"""Nothing but the response and the merge."""


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    return textured()


@pytest.fixture(scope="module")
def sound(scene) -> Bracket:
    return Bracket(exposed(scene, [Exposure(t) for t in SECONDS]))


@pytest.fixture(scope="module")
def told() -> list[str]:
    """What is said of the progress of `whole`."""
    return []


@pytest.fixture(scope="module")
def whole(sound, told) -> MergeResult:
    """`sound` with nothing known and nothing switched off."""
    return merge_brackets(sound, progress=told.append)


def ratios(picture: RadianceMap, truth: np.ndarray) -> np.ndarray:
    """Measured radiance over the truth, where it was measured."""
    return (picture.radiance / truth)[picture.clipped == 0]


def misreported(bracket: Bracket, place: int, stops: float) -> Bracket:
    photographs = list(bracket.photographs)
    exposure = photographs[place].exposure
    assert exposure is not None
    photographs[place] = replace(
        photographs[place], exposure=replace(exposure, seconds=exposure.seconds * 2.0**stops, source="EXIF")
    )
    return Bracket(tuple(photographs))


def test_a_sound_bracket_is_measured_and_nothing_is_said_against_it(scene, sound, whole):
    (one,) = whole.brackets
    found = ratios(one.picture, scene)
    assert (one.picture.clipped == 0).mean() > 0.99 and one.picture.unit == "relative"
    # White is neutral, so the channels' scales are one; what is left of each pixel is noise.
    assert np.median(found, axis=0) / np.median(found) == pytest.approx(np.ones(3), abs=0.01)
    assert np.percentile(found / np.median(found), (1, 99)) == pytest.approx((1, 1), abs=0.04)
    assert whole.warnings == whole.notes == whole.messages == ()
    assert whole.camera.name == MAKER and one.name == "frame_0.png … frame_7.png"
    assert [frame.seconds for frame in one.frames] == pytest.approx(SECONDS, rel=0.02)
    assert one.aligned is not None and not one.aligned.moved
    assert one.deghosted is not None and not one.deghosted.ghosts.any()
    assert one.scale is None and one.balance is None
    assert whole.camera.calibration is not None and whole.camera.calibration.response is whole.response
    assert one.clipping == clipping_report(one.picture)


def test_the_steps_come_in_their_order_and_are_timed(whole, told):
    assert list(dict.fromkeys(told)) == ["check", "align", "response", "deghost", "merge"]
    assert told.index("response") > told.index("align") and told[-2:] == ["deghost", "merge"]
    assert list(whole.seconds) == ["check", "align", "response", "deghost", "merge"]
    assert all(seconds > 0 for seconds in whole.seconds.values())


def test_what_is_switched_off_is_not_done(sound):
    said: list[str] = []
    found = merge_brackets(sound, profile=known_response(), settings=PLAIN, progress=said.append)
    assert said == ["check", "merge"]
    (one,) = found.brackets
    assert one.aligned is None and one.deghosted is None and found.camera.calibration is None
    assert np.array_equal(one.picture.radiance, merge(sound, known_response()).radiance)
    by_paper = merge_brackets(sound, profile=known_response(), settings=replace(PLAIN, weighting=Hat()))
    wanted = merge(sound, known_response(), weighting=Hat()).radiance
    assert np.array_equal(by_paper.brackets[0].picture.radiance, wanted)
    assert not np.array_equal(wanted, one.picture.radiance)


def test_a_photograph_alone_is_measured_by_a_known_response(scene):
    alone = Bracket(exposed(scene, [Exposure(0.01)]))
    found = merge_brackets(alone, profile=known_response())
    assert found.brackets[0].deghosted is None and found.warnings == ()
    assert np.median(ratios(found.brackets[0].picture, scene)) == pytest.approx(1, abs=0.01)
    with pytest.raises(NotABracket, match="one photograph, so the camera's response cannot be recovered"):
        merge_brackets(alone)


def test_a_known_response_is_taken_as_it_is(scene, sound):
    response = known_response()
    wrong = misreported(sound, 3, 1 / 3)
    found = merge_brackets(wrong, profile=response)
    assert found.response is response and found.camera.calibration is None
    assert [frame.seconds for frame in found.brackets[0].frames] == wrong.exposures.tolist()
    # The scale is the response's own: the virtual camera's, whose radiance 1 is white at one second.
    assert np.median(ratios(merge_brackets(sound, profile=response).brackets[0].picture, scene)) == pytest.approx(
        1, abs=0.01
    )
    assert "frame_3.png" in found.warnings[0]


def test_a_known_response_helps_to_doubt_the_exposures(scene):
    # Of three photographs a curve that must be fitted as well cannot say that the first is off by a third of a stop.
    wrong = misreported(Bracket(exposed(scene, [Exposure(t) for t in (1 / 256, 1 / 64, 1 / 16)])), 0, 1 / 3)
    lines = merge_brackets(wrong, profile=known_response(), settings=PLAIN).warnings
    assert len(lines) == 1 and "frame_0.png" in lines[0] and "a third of a stop" in lines[0]


def test_a_wrong_exposure_is_corrected_or_reported_where_that_is_switched_off(scene, sound):
    wrong = misreported(sound, 3, 1 / 3)
    refined = merge_brackets(wrong, settings=replace(PLAIN, refine=True))
    assert [frame.seconds for frame in refined.brackets[0].frames] == pytest.approx(SECONDS, rel=0.02)
    found = ratios(refined.brackets[0].picture, scene)
    assert np.percentile(found / np.median(found), (1, 99)) == pytest.approx((1, 1), abs=0.05)
    assert not any("a third of a stop" in line for line in refined.warnings)
    as_asked = merge_brackets(wrong, settings=PLAIN)
    assert as_asked.camera.calibration is not None and as_asked.camera.calibration.ratios is None
    assert [frame.seconds for frame in as_asked.brackets[0].frames] == wrong.exposures.tolist()
    assert [line for line in as_asked.warnings if "frame_3.png" in line and "a third of a stop" in line]


def test_a_hand_held_bracket_is_measured_as_its_reference_saw_it():
    size = (420, 300)
    light = luminance(*size, np.random.default_rng(5))
    shaken = stack(4, size=size, frames=5, scene=light)
    whole = merge_brackets(shaken.bracket)
    aligned = whole.brackets[0].aligned
    assert aligned is not None and aligned.moved
    motions = np.array([[motion.dx, motion.dy, motion.angle] for motion in aligned.motions])
    assert shaken.errors(motions, aligned.reference)[0].max() < 0.25
    # Green has no tint: it is the scene itself, seen from where the reference was held.
    y, x = np.mgrid[: size[1], : size[0]]
    still = unplaced(
        np.stack([x.ravel() + 0.5 - size[0] / 2, y.ravel() + 0.5 - size[1] / 2], -1), shaken.motions[aligned.reference]
    )
    places = [(still[:, i] + n / 2 + MARGIN) * FINE - 0.5 for i, n in ((1, size[1]), (0, size[0]))]
    truth = np.maximum(map_coordinates(light, places, order=1), 1e-9).reshape(size[1], size[0])

    def misfit(measurement: MergeResult) -> float:
        picture = measurement.brackets[0].picture
        found = np.log(picture.radiance[..., 1] / truth)[picture.clipped == 0]
        return float(np.percentile(np.abs(found - np.median(found)), 90))

    apart = merge_brackets(shaken.bracket, profile=whole.response, settings=PLAIN)
    # What is left is noise and the splines' own blur; doubled edges are ten times as much.
    assert misfit(whole) < 0.06
    assert misfit(apart) > 5 * misfit(whole)


def test_what_moved_is_left_out_unless_that_is_switched_off():
    moving = moving_scene(1, shape=(200, 300))
    bracket, response = moving.bracket(), known_response()
    with_ghosts = merge_brackets(bracket, profile=response, settings=PLAIN).brackets[0]
    without = merge_brackets(bracket, profile=response, settings=MergeSettings(align=False)).brackets[0]
    assert without.deghosted is not None and without.deghosted.ghosts.mean() > 0.01
    elsewhere = ~without.deghosted.ghosts
    assert np.array_equal(with_ghosts.picture.radiance[elsewhere], without.picture.radiance[elsewhere])
    shown = without.deghosted.sources >= 0
    truth = np.choose(np.maximum(without.deghosted.sources, 0)[..., None], list(moving.instants))

    def misfit(picture: RadianceMap) -> float:
        return float(np.percentile(np.abs(np.log(picture.radiance / truth)[shown & (picture.clipped == 0)]), 90))

    assert misfit(without.picture) < 0.3 * misfit(with_ghosts.picture)
    # The photographs themselves stay as they were given.
    assert all(photograph.outside is None for photograph in bracket.photographs)


def test_brackets_of_one_camera_come_out_on_one_scale(scene):
    short = named(Bracket(exposed(scene, [Exposure(t) for t in SECONDS[:6]])), "a_", camera=MAKER)
    long = named(Bracket(exposed(scene, [Exposure(t) for t in (0.3, 0.1, 0.03, 0.01)], seed=3)), "b_", camera=MAKER)
    stopped = named(
        Bracket(exposed(scene, [Exposure(t, 8.0, 400.0) for t in (0.2, 0.8, 3.2)], seed=5)), "c_", camera=MAKER
    )
    found = merge_brackets([short, long, stopped], settings=MergeSettings(refine=True))
    first, *others = (one.picture for one in found.brackets)
    assert [one.name[:2] for one in found.brackets] == ["a_", "b_", "c_"]
    for other in others:
        both = (first.clipped == 0) & (other.clipped == 0)
        assert both.mean() > 0.5
        assert np.median((other.radiance / first.radiance)[both]) == pytest.approx(1, abs=0.015)


def test_a_photograph_beside_a_bracket_of_its_camera_is_measured_by_their_response(scene):
    bracket = named(Bracket(exposed(scene, [Exposure(t) for t in SECONDS[1:7]])), "a_", camera=MAKER)
    alone = named(Bracket(exposed(scene, [Exposure(0.01)], seed=8)), "b_", camera=MAKER)
    settings = replace(PLAIN, refine=True)
    of_bracket, of_alone = (one.picture for one in merge_brackets([bracket, alone], settings=settings).brackets)
    both = (of_bracket.clipped == 0) & (of_alone.clipped == 0)
    assert np.median((of_alone.radiance / of_bracket.radiance)[both]) == pytest.approx(1, abs=0.01)
    with pytest.raises(NotABracket, match="no photographs were given"):
        merge_brackets([])


def test_what_the_lens_did_is_undone_once_and_in_order(sound):
    """The veil lies over the vignetted light, the white card is read in what is left, the meter last of all."""
    response, seen = known_response(), {}
    glare, vignetting = Glare(veil=0.01), Vignetting((-0.4,))
    gains, scale = ChannelGains((1.5, 1.0, 0.5)), Scale((7.0, 8.0, 9.0), 0.1, "a test")

    def given(name: str, answer):
        def maker(picture: RadianceMap, *others: object):
            assert name not in seen
            seen[name] = (picture, others)
            return answer

        return maker

    settings = MergeSettings(
        glare=given("glare", glare),
        vignetting=[vignetting],
        balance=given("balance", gains),
        scale=given("scale", scale),
    )
    found = merge_brackets(sound, profile=response, settings=settings)
    one = found.brackets[0]
    merged = merge(sound, response)
    clear = diminish_glare(merged, glare).picture
    even = corrected(clear, vignetting)
    white = apply_balance(even, gains)
    for name, wanted in (("glare", merged), ("balance", even), ("scale", white)):
        assert np.array_equal(seen[name][0].radiance, wanted.radiance), name
    assert np.array_equal(one.picture.radiance, apply_scale(white, scale).radiance)
    assert one.picture.variance is not None and white.variance is not None
    wanted = apply_scale(white, scale).variance
    assert wanted is not None and np.array_equal(one.picture.variance, wanted)
    assert one.picture.unit == "cd/m²" and one.scale is scale and one.balance is gains
    bracket, known = seen["scale"][1]
    assert known is response and bracket.exposures.tolist() == sound.exposures.tolist()
    assert list(found.seconds) == ["check", "align", "deghost", "merge", "glare"]


def test_the_vignetting_of_the_photographs_aperture_counts(scene):
    stopped = Bracket(exposed(scene, [Exposure(t, 8.0) for t in (0.2, 0.8)]))
    wide, narrow = Vignetting((-0.5,), f_number=2.0), Vignetting((-0.1,), f_number=8.0)
    settings = replace(PLAIN, vignetting=(wide, narrow))
    found = merge_brackets(stopped, profile=known_response(), settings=settings)
    wanted = corrected(merge(stopped, known_response()), narrow)
    assert np.array_equal(found.brackets[0].picture.radiance, wanted.radiance)
    # Where it is of another aperture that is said, in the result and not aloud.
    found = merge_brackets([stopped, stopped], profile=known_response(), settings=replace(PLAIN, vignetting=(wide,)))
    assert len(found.messages) == 1 and "measured at f/2, the photographs are at f/8" in found.messages[0]
    assert found.notes == found.messages and found.warnings == ()


def test_the_caller_s_own_warnings_stay_his(sound):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        merge_brackets(sound, profile=known_response(), settings=PLAIN)
        warnings.warn("his own", stacklevel=1)
    assert [str(w.message) for w in caught] == ["his own"]


def test_what_degrades_is_an_objection_and_what_is_well_to_know_a_note(whole):
    doubts = (
        BracketDoubt("a.jpg", "is of another scene", "leave it out", True),
        BracketDoubt("b.jpg", "the ISO varies", "switch it off", False),
        BracketDoubt("c.jpg", "not in order", NOTHING_TO_DO, False),
    )
    doubted = replace(whole, brackets=(replace(whole.brackets[0], doubts=doubts),), messages=("the wall is uneven",))
    assert doubted.warnings == ("a.jpg: is of another scene; leave it out",)
    assert doubted.notes == ("the wall is uneven", "b.jpg: the ISO varies; switch it off")


def test_a_response_that_fits_badly_is_an_objection(whole):
    def with_misfit(residual: float) -> MergeResult:
        calibration = replace(whole.camera.calibration, residual=np.array([0.01, residual, 0.01]))
        return replace(whole, cameras={MAKER: replace(whole.camera, calibration=calibration)})

    assert with_misfit(0.99 * DOUBTFUL_MISFIT).warnings == ()
    (line,) = with_misfit(1.5 * DOUBTFUL_MISFIT).warnings
    assert f"the response fits badly (misfit {1.5 * DOUBTFUL_MISFIT:.2f} of ln exposure)" in line


def test_times_in_a_wrong_order_are_objected_to(sound):
    seconds = [SECONDS[i] for i in (3, 0, 6, 1, 7, 2, 5, 4)]
    mixed = Bracket(tuple(replace(p, exposure=Exposure(t)) for p, t in zip(sound.photographs, seconds, strict=True)))
    lines = merge_brackets(mixed, settings=MergeSettings(deghost=False)).warnings
    assert any("in another order" in line for line in lines) and any("fits badly" in line for line in lines)


def test_where_there_is_no_response_the_doubt_says_why():
    pixels = np.full((40, 60, 3), 100, np.uint8)
    pixels[:, ::7] += 3
    flat = Bracket(tuple(Photograph(pixels + i, f"flat_{i}.png", Exposure(0.1 * 2**i)) for i in range(3)))
    with pytest.raises(NotABracket) as caught:
        merge_brackets(flat, settings=MergeSettings(align=False))
    assert "flat_" in str(caught.value) and "levels" in str(caught.value) and "\n" not in str(caught.value)
    assert isinstance(caught.value.__cause__, NotABracket)


def test_photographs_of_16_bits_and_a_response_of_8_are_refused_plainly(scene):
    deep = [
        replace(p, pixels=p.pixels.astype(np.uint16) * 257) for p in exposed(scene, [Exposure(t) for t in SECONDS[2:5]])
    ]
    with pytest.raises(NotABracket, match="65536"):
        merge_brackets(Bracket(tuple(deep)), profile=known_response())


def test_grey_is_where_it_is_said_to_be(sound, whole):
    assert whole.response is not None
    assert np.ptp(whole.response.log_exposure[:, 255]) == pytest.approx(0, abs=1e-12)
    film = merge_brackets(sound, settings=replace(PLAIN, neutral=128))
    assert film.response is not None
    assert np.ptp(film.response.log_exposure[:, 128]) == pytest.approx(0, abs=1e-12)
    assert np.ptp(film.response.log_exposure[:, 255]) > 0.01
    with pytest.raises(ValueError, match="neutral is 256; the photographs' pixel values are 0 to 255"):
        merge_brackets(sound, settings=replace(PLAIN, neutral=256))


def test_solid_angles_are_those_of_the_photographs_or_of_what_is_given(scene):
    photographs = exposed(scene, [Exposure(0.1)])
    said = Bracket(tuple(replace(p, focal_length=200.0) for p in photographs))
    response = known_response()
    own = merge_brackets(said, profile=response).brackets[0].clipping
    given = merge_brackets(said, profile=response, settings=MergeSettings(focal_length=400.0)).brackets[0].clipping
    unknown = merge_brackets(Bracket(photographs), profile=response).brackets[0].clipping
    assert own.saturated == given.saturated == unknown.saturated > 100
    assert own.solid_angle is not None and given.solid_angle is not None and unknown.solid_angle is None
    assert own.solid_angle > 2 * given.solid_angle > 0
    assert own == clipping_report(merge_brackets(said, profile=response).brackets[0].picture, focal_length=200.0)


def test_noise_is_carried_through(scene):
    """Normalised by their own variance, errors of a known camera have variance 1, whatever was done to the map."""
    bracket = Bracket(exposed(scene, [Exposure(t) for t in SECONDS], camera=CAMERA, seed=9))
    settings = MergeSettings(
        balance=lambda _: ChannelGains((2.0, 1.0, 0.5)), scale=lambda *_: Scale.grey(100.0, 0.0, "a test")
    )
    picture = merge_brackets(bracket, profile=known_response(), settings=settings).brackets[0].picture
    assert picture.variance is not None
    truth = scene * np.array([200.0, 100.0, 50.0])
    normalised = ((picture.radiance - truth) / np.sqrt(picture.variance))[picture.clipped == 0]
    assert normalised.std() == pytest.approx(1, abs=0.1)


def test_a_reading_in_the_first_bracket_scales_them_all():
    """Two views of one shoot stay on one scale: what is read of the first is not read again of the second."""
    scene = wide_scene()
    brackets = [named(NOISELESS.bracket(scene), "first"), named(NOISELESS.bracket(3 * scene[:, ::-1]), "second")]
    settings = MergeSettings(scale=lambda picture, *_: scale_from_spot(picture, 90, 60, 100.0))
    first, second = merge_brackets(brackets, settings=settings).brackets
    assert first.scale == second.scale
    ratio = second.picture.radiance[:, ::-1] / first.picture.radiance
    assert np.median(ratio) == pytest.approx(3.0, rel=0.02)


@pytest.mark.parametrize(
    "shares, said",
    [
        ([0.05, 0.0, 0.04, 0.03], True),
        ([0.05, 0.01, 0.04, 0.03], False),
        ([0.05, 0, 0, 0.03], False),
        ([0.3, 0, 0.3], False),
    ],
    ids=["one against three", "the reference gave way too", "one agrees with it", "one against two"],
)
def test_one_frame_against_all_others_is_reported(shares, said):
    """The frame that the others are measured against may be the one that does not belong to them."""
    bracket = NOISELESS.bracket(wide_scene(32, 24), [0.1 * 2.0**k for k in range(len(shares))])
    found = Deghosted(bracket, np.zeros((24, 32), bool), np.zeros((24, 32), np.int16), np.array(shares), 1)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        _warn_of_an_odd_frame(found)
    lines = [str(each.message) for each in caught]
    assert (len(lines) == 1 and "frame_1.jpg: in 3 %" in lines[0]) if said else not lines
