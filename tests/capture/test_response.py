"""Recovering the response: the true curve of a virtual camera comes back, and only the scale is free."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.merging import hat, merge
from relume.capture.response.calibration import recover_response
from relume.capture.response.debevec_malik import DebevecMalik, Equations, roughness
from relume.capture.response.sampling import Observations, observations
from relume.errors import NotABracket
from relume.image.colour import luminance
from relume.image.files import read_radiance
from relume.image.photograph import Exposure
from synthetic import NOISELESS, NOISY, VirtualCamera, wide_scene

MIDDLE = 127
SURE = slice(10, 246)
"""The pixel values over which curves are compared: outside, a value is hardly weighted and few pixels have it."""


def misfit(recovered: np.ndarray, true: np.ndarray) -> np.ndarray:
    """|Δ ln exposure| of every sure value, (3, 236), after the free scale of each channel is taken out."""
    difference = (recovered - true)[:, SURE]
    return np.abs(difference - np.median(difference, axis=1, keepdims=True))


@pytest.mark.parametrize(
    "camera, tolerance",
    [
        # Rounding to 8 bits leaves 0.02 % here; the goal (G16) is 0.5 %.
        pytest.param(NOISELESS, 0.001, id="without noise"),
        # 1.5 pixel values of noise leave 0.05 to 0.1 %; the goal is 1.5 %.
        pytest.param(NOISY, 0.005, id="with noise"),
        pytest.param(VirtualCamera((1e-4, 1e-4, 1e-4), (1.0, 1.2, 1.4), (9.0, 9.0, 9.0)), 0.005, id="nearly linear"),
        pytest.param(VirtualCamera((0.01, 0.01, 0.01), (2.6, 2.8, 2.4), (0.5, 0.5, 0.5)), 0.005, id="contrasty"),
    ],
)
def test_the_recovered_response_is_the_camera_s_own(camera, tolerance):
    recovered = recover_response(camera.bracket(wide_scene())).response
    error = misfit(recovered.log_exposure, camera.log_exposure())
    assert np.median(error, axis=1).max() <= tolerance
    # The toe, where a level is 10 % of its exposure, is the worst of it: two levels there.
    assert np.percentile(error, 90) <= 0.05


@pytest.mark.filterwarnings(
    "ignore:.*pixels show the .* response; it is uncertain"
)  # the noisiest camera leaves few even pixels
def test_the_curve_rises_everywhere():
    for seed, electrons in [(1, 12_000.0), (2, 1_500.0), (3, 400.0)]:
        camera = VirtualCamera(electrons=electrons, read_noise=10.0)
        response = recover_response(camera.bracket(wide_scene(96, 64), seed=seed)).response
        assert np.all(np.diff(response.log_exposure, axis=1) > 0)


def test_a_response_from_too_few_pixels_is_reported_as_uncertain():
    # The paper asks for N(P − 1) > 255; 24×16 pixels over nine stops were seen to be a quarter off.
    with pytest.warns(UserWarning, match=r"only \d+ pixels show the .* response; it is uncertain"):
        recover_response(VirtualCamera().bracket(wide_scene(12, 8)))


def test_the_middle_value_has_unit_exposure(calibration):
    assert calibration.response.log_exposure[:, MIDDLE] == pytest.approx([0, 0, 0], abs=1e-6)
    assert calibration.response.levels == 256


def test_a_curve_that_would_fall_is_the_best_that_does_not():
    # Hardly any pixels, much noise and next to no smoothing: the least squares curve falls.
    generator = np.random.default_rng(2)
    light = generator.uniform(0.1, 0.9, (60, 1))
    log_exposures = np.log([0.5, 1.0])
    values = np.clip(np.rint(255 * light * [0.5, 1.0] + generator.normal(0, 6, (60, 2))), 1, 254).astype(int)
    observed = [Observations(values, log_exposures)]
    smoothing = {"smoothness": 1e-3, "power_law": False, "difference": 2, "steepness": False}
    equations = Equations.of(observed, 256)
    matrix = equations.normal + 1e-3 * equations.pixels * roughness(2, False)

    def objective(curve: np.ndarray) -> float:
        return float(curve @ matrix @ curve - 2 * equations.right @ curve)

    free = np.linalg.lstsq(matrix, equations.right, rcond=None)[0]
    assert np.diff(free).min() < -0.01
    best, _ = DebevecMalik(**smoothing).curve(observed, 256)
    raised, _ = DebevecMalik(**smoothing, monotone=False).curve(observed, 256)
    assert np.all(np.diff(best) > 0) and np.all(np.diff(raised) > 0)
    # The slow twin: bounded least squares over the increments, by another algorithm.
    values_of, vectors = np.linalg.eigh(matrix)
    kept = values_of > 1e-14 * values_of[-1]
    root = np.sqrt(values_of[kept])[:, None] * vectors[:, kept].T
    target = vectors[:, kept].T @ equations.right / np.sqrt(values_of[kept])
    bounds = (np.r_[-np.inf, np.zeros(255)], np.inf)
    twin = np.cumsum(lsq_linear(root @ np.tril(np.ones((256, 256))), target, bounds, method="bvls").x)
    gap = objective(raised) - objective(twin)
    assert gap > 0
    assert objective(best) - objective(twin) < 0.01 * gap


PAPER = DebevecMalik(smoothness=30.0, power_law=False, difference=2, steepness=False)
"""Eq. 3 as it is printed."""


def dense_least_squares(values: np.ndarray, log_times: np.ndarray, smoothness: float) -> np.ndarray:
    """The slow twin: `gsolve` of the paper's appendix, every ln E an unknown, eq. 3 with the weights of eq. 4.

    Three letters of the printed routine are corrected: the column of ln E is n+i, not n+1, b(k) holds one value,
    and its l is λ. λ is under the square as in eq. 3 and counted once a pixel, as recover_response does.
    """
    pixels, photographs = values.shape
    weight = hat(256)
    rows, right = [], []
    for i in range(pixels):
        for j in range(photographs):
            w = weight[values[i, j]]
            row = np.zeros(256 + pixels)
            row[values[i, j]], row[256 + i] = w, -w
            rows.append(row)
            right.append(w * log_times[j])
    middle = np.zeros(256 + pixels)
    middle[MIDDLE] = 1000.0
    rows.append(middle)
    right.append(0.0)
    for z in range(1, 255):
        row = np.zeros(256 + pixels)
        row[z - 1 : z + 2] = np.sqrt(smoothness * pixels) * weight[z] * np.array([1.0, -2.0, 1.0])
        rows.append(row)
        right.append(0.0)
    # By QR: singular values take six times as long, and no column is without a row.
    q, r = np.linalg.qr(np.stack(rows))
    return np.linalg.solve(r, q.T @ np.array(right))[:256]


@pytest.mark.parametrize("camera", [NOISELESS, NOISY], ids=["without noise", "with noise"])
def test_the_reduced_equations_solve_the_paper_s_own_system(camera):
    bracket = camera.bracket(wide_scene(32, 24, stops=4.0, brightest=8.0), [1 / 64, 1 / 32, 1 / 16, 1 / 8])
    response = recover_response(bracket, method=PAPER).response
    for channel in range(3):
        values, log_times = observations(bracket, channel)
        assert len(values) > 250
        twin = dense_least_squares(values, log_times, 30.0)
        twin -= twin[MIDDLE]
        seen = slice(values[values > 0].min(), values.max() + 1)
        # 1.3e-7 of it is the hair that keeps a level curve rising. Where no value was seen the line that goes on is
        # held by its end alone, and the squared condition number of the reduced equations shows.
        np.testing.assert_allclose(response.log_exposure[channel, seen], twin[seen], atol=1e-6)
        np.testing.assert_allclose(response.log_exposure[channel], twin, atol=1e-5)


@pytest.mark.parametrize("exponent", [1.0, pytest.param(1.7, marks=pytest.mark.slow), 2.2])  # slow: the others go red
def test_a_camera_that_is_a_power_law_is_recovered_as_one(exponent):
    camera = VirtualCamera((0.0, 0.0, 0.0), (exponent, exponent, exponent), (1e9, 1e9, 1e9))
    bracket = camera.bracket(wide_scene())
    expected = exponent * np.log(np.arange(1, 256) / MIDDLE)
    error = {}
    for power_law in (True, False):
        recovered = recover_response(
            bracket, method=DebevecMalik(power_law=power_law, difference=2)
        ).response.log_exposure
        error[power_law] = np.abs(recovered[:, 1:] - expected)
    # Down to the dark end, where hardly a value is seen and a level is a tenth of its exposure.
    assert error[True][:, 29:245].max() < 0.01 and error[True][:, 9:].max() < 0.05
    # The paper's own term straightens the bend of the curve itself.
    assert error[True].max() < error[False].max()


def test_more_smoothness_makes_the_curve_straighter():
    bracket = NOISY.bracket(wide_scene(96, 64))
    bends = [
        np.abs(
            np.diff(recover_response(bracket, method=replace(PAPER, smoothness=s)).response.log_exposure[:, SURE], n=2)
        ).sum()
        for s in (0.1, 30.0, 3000.0)
    ]
    assert bends[0] > bends[1] > bends[2]


def test_the_order_of_the_files_changes_nothing(bracket, calibration):
    shuffled = Bracket(tuple(bracket.photographs[i] for i in (4, 0, 8, 2, 7, 1, 3, 6, 5)))
    assert [p.name for p in shuffled.photographs] == [p.name for p in bracket.photographs]
    np.testing.assert_array_equal(recover_response(shuffled).response.log_exposure, calibration.response.log_exposure)


@pytest.mark.parametrize("factor", [1e-3, 7.0])
def test_the_times_may_all_be_wrong_by_one_factor(bracket, calibration, factor):
    scaled = Bracket(tuple(replace(p, exposure=Exposure(p.exposure.seconds * factor)) for p in bracket.photographs))
    np.testing.assert_allclose(
        recover_response(scaled).response.log_exposure, calibration.response.log_exposure, atol=1e-6
    )


def test_a_photograph_given_twice_changes_nothing_to_speak_of(bracket, calibration):
    for index in (0, 8):
        twice = Bracket((*bracket.photographs, replace(bracket.photographs[index], name="again.jpg")))
        again = recover_response(twice).response.log_exposure
        # A frame that counts twice draws the curve towards its own rounding errors.
        assert np.median(misfit(again, calibration.response.log_exposure)) <= 1e-3


def test_shutter_aperture_and_gain_are_one_exposure(scene, calibration):
    # The same seven factors of two, made in turn by the shutter, the aperture and the ISO.
    exposures = [
        Exposure(1 / 2, 1.0, 100),
        Exposure(1 / 4, 1.0, 100),
        Exposure(1 / 4, np.sqrt(2.0), 100),
        Exposure(1 / 4, 2.0, 100),
        Exposure(1 / 32, 1.0, 100),
        Exposure(1 / 256, 1.0, 400),
        Exposure(1 / 512, 2.0, 1600),
    ]
    factors = [e.factor for e in exposures]
    assert factors == pytest.approx([1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64, 1 / 128])
    mixed = Bracket(tuple(NOISELESS.photograph(scene, e) for e in exposures))
    plain = NOISELESS.bracket(scene, factors)
    np.testing.assert_allclose(
        recover_response(mixed).response.log_exposure, recover_response(plain).response.log_exposure, atol=1e-6
    )


def test_several_brackets_of_one_camera_speak_together():
    # Neither alone sees the whole curve: one is dark, one is bright.
    camera, seconds = NOISELESS, [1 / 8, 1 / 4]
    dark = camera.bracket(wide_scene(96, 64, stops=4.0, brightest=0.6), seconds)
    bright = camera.bracket(wide_scene(96, 64, stops=4.0, brightest=12.0), seconds)
    true = camera.log_exposure()
    alone = [np.median(misfit(recover_response(b).response.log_exposure, true)) for b in (dark, bright)]
    together = np.median(misfit(recover_response([dark, bright]).response.log_exposure, true))
    assert together < min(alone)
    assert together <= 0.01


def test_a_photograph_alone_beside_a_bracket_neither_helps_nor_hinders(bracket, calibration):
    lone = NOISELESS.bracket(wide_scene(48, 32), [1 / 60])
    np.testing.assert_array_equal(
        recover_response([lone, bracket]).response.log_exposure, calibration.response.log_exposure
    )


def test_the_observations_lie_on_the_curve(calibration):
    for channel, points in enumerate(calibration.samples):
        assert points.shape[1] == 2 and len(points) > 1000
        value = points[:, 1].astype(int)
        off = points[:, 0] - calibration.response.log_exposure[channel, value]
        # A value between 30 and 225 is asked to half a level, which is at most 3 % of its exposure.
        inner = (value > 30) & (value < 225)
        assert np.percentile(np.abs(off[inner]), 95) < 0.03
    assert np.all(calibration.residual < 0.02)


def test_the_memorial_church_gives_a_film_s_curve_and_its_published_radiance(shared):
    folder = shared / "data/brackets/memorial"
    listed = [line.split() for line in (folder / "image_list.txt").read_text().splitlines() if line[:1] != "#"]
    listed = [words for words in listed if words]
    whole = read_bracket([folder / w[0] for w in listed], times=[float(w[1]) for w in listed])
    assert len(whole.photographs) == 16 and whole.exposures[-1] / whole.exposures[0] == pytest.approx(2**15)
    inner = (slice(60, -60), slice(60, -60))  # the blue borders of the shifted scans
    bracket = Bracket(tuple(replace(p, pixels=p.pixels[inner]) for p in whole.photographs))

    calibration = recover_response(bracket)
    g = calibration.response.log_exposure
    assert np.all(np.diff(g, axis=1) > 0)
    # From the image the film shows of its range, 4.1, 4.0 and 4.7 powers of e (Fig. 7). Below 25 lies the film's base
    # fog: values of 12 to 18 occur in the darkest places of every photograph, however short, and say nothing.
    assert g[:, 240] - g[:, 30] == pytest.approx([4.08, 4.02, 4.65], abs=0.3)
    assert np.all(calibration.residual < 1.2)

    merged = merge(bracket, calibration.response)
    published = read_radiance(folder / "memorial.hdr").radiance[inner]
    known = (merged.clipped == 0) & (published.min(-1) > 0)
    ours, theirs = merged.radiance[known].astype(float), published[known].astype(float)
    ours *= np.exp(np.median(np.log(theirs / ours), axis=0))
    correlation = np.corrcoef(np.log(luminance(ours)), np.log(luminance(theirs)))[0, 1]
    # Measured: 0.9995, and 2 to 3 % apart at the median pixel; the published map was merged by other weights.
    assert correlation > 0.995
    assert np.median(np.abs(np.log(ours / theirs)), axis=0).max() < 0.05


def test_identical_photographs_of_other_exposures_are_refused_in_words():
    photographs = NOISY.bracket(wide_scene()).photographs[:3]
    alike = tuple(replace(photographs[1], name=each.name, exposure=each.exposure) for each in photographs)
    with pytest.raises(NotABracket, match=r"said to be 2\.0 stops apart show identical values"):
        recover_response(Bracket(alike))
