"""Single exposures: one photograph through a known response, and a negative scanned at two density settings."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import Hat, merge
from relume.capture.response.calibration import recover_response
from relume.capture.response.camera_profile import CameraProfile, write_profile
from relume.capture.scans import merge_scan_files, merge_scans
from relume.errors import NotABracket
from relume.image.files import read_photograph, write
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import BLACK, OUTSIDE, SATURATED
from relume.image.response import Response
from synthetic import NOISELESS, wide_scene

TAKEN = Exposure(1.0)


def single(photograph, response):
    """The radiance map of one photograph: a bracket of one."""
    return merge(Bracket((photograph,)), response)


@dataclass(frozen=True)
class Scanner:
    """A print film of gamma 0.65 over three density units, digitised between two densities, and turned positive.

    thinnest, densest : density above fog that becomes 0 and 255: the density adjustment
    noise : of a pixel value, from grain and digitising
    """

    thinnest: float
    densest: float
    noise: float = 0.7

    def values(self, exposure: np.ndarray) -> np.ndarray:
        """Pixel values, not rounded or clipped, of exposures (…, 3)."""
        # Hurter and Driffield's curve: straight between a toe at ln exposure −8 and a shoulder at 2.5, by softplus.
        log_exposure = np.log(np.maximum(exposure, 1e-9))
        straight = 0.65 / np.log(10) * (np.logaddexp(0, log_exposure + 8) - np.logaddexp(0, log_exposure - 2.5))
        return 255 * (straight - self.thinnest) / (self.densest - self.thinnest)

    def scan(
        self, exposure: np.ndarray, *, seed: int = 0, name: str = "scan.tif", taken: Exposure = TAKEN
    ) -> Photograph:
        noise = self.noise * np.random.default_rng(seed).standard_normal(exposure.shape)
        pixels = np.rint(np.clip(self.values(exposure) + noise, 0, 255)).astype(np.uint8)
        return Photograph(pixels, name, taken)

    def response(self) -> Response:
        """The true curve, on the scale the paper would recover it on: value 127 has unit exposure."""
        steps = np.geomspace(1e-6, 1e4, 200_001)
        values = self.values(np.repeat(steps[:, None], 3, axis=1))[:, 0]
        log_exposure = np.interp(np.arange(256), values, np.log(steps))
        log_exposure -= log_exposure[127]
        return Response(np.tile(log_exposure, (3, 1)), np.full(3, np.hypot(self.noise, 12**-0.5)))


SHADOWS, LIGHTS = Scanner(0.1, 1.6), Scanner(1.2, 2.9)


def negative(width: int = 160, height: int = 120) -> np.ndarray:
    """Exposures (H, W, 3) over four orders of magnitude, from left to right, one channel a little behind another."""
    ramp = np.broadcast_to(np.linspace(-7.2, 1.8, width)[None, :, None], (height, width, 3))
    return np.exp(ramp + np.array([0.0, 0.15, -0.1]))


def scanned(exposure: np.ndarray, seed: int = 0) -> list[tuple[Photograph, Response]]:
    """A negative at both density settings."""
    return [
        (scanner.scan(exposure, seed=seed + i, name=f"scan_{i}.tif"), scanner.response())
        for i, scanner in enumerate((SHADOWS, LIGHTS))
    ]


def both() -> list[tuple[Photograph, Response]]:
    return scanned(negative(), 10)


def test_two_scans_cover_more_than_either():
    merged = merge_scans(both())
    measured = np.isfinite(merged.variance)  # type: ignore[call-overload]
    alone = [np.isfinite(single(*scan).variance).mean() for scan in both()]  # type: ignore[call-overload]
    assert measured.mean() > 1.5 * max(alone) and measured.mean() > 0.9
    # Three units of density at gamma 0.65 are four and a half orders of magnitude; this negative holds 3.9 of them.
    light = merged.radiance[measured]
    assert np.log10(light.max() / light.min()) > 3.5


def test_the_combined_map_is_right_within_its_noise():
    merged = merge_scans(both())
    assert merged.variance is not None and merged.clipped is not None
    true = negative()
    for channel in range(3):
        where = np.isfinite(merged.variance[..., channel])
        error = np.log(merged.radiance[..., channel][where] / true[..., channel][where])
        deviation = np.sqrt(merged.variance[..., channel][where]) / merged.radiance[..., channel][where]
        # One factor for the whole range: no step where one scan takes over from the other.
        apart = (error - np.median(error)) / deviation
        assert 0.9 < apart.std() < 1.1
        # Per decade of exposure the mean error is nothing.
        decade = np.floor(np.log10(true[..., channel][where])).astype(int)
        for one in np.unique(decade):
            assert abs(error[decade == one].mean() - np.median(error)) < 0.006
    # The first scan's response sets the scale: its value 127 has unit exposure.
    at_middle = np.exp(np.interp(127, SHADOWS.values(true[0])[:, 0], np.log(true[0, :, 0])))
    assert np.median(merged.radiance[..., 0] / true[..., 0]) == pytest.approx(1 / at_middle, rel=0.005)


def test_each_scan_s_own_scale_does_not_matter():
    first, (photograph, response) = both()
    moved = replace(response, log_exposure=response.log_exposure + np.array([[1.3], [-0.7], [0.2]]))
    np.testing.assert_allclose(
        merge_scans([first, (photograph, moved)]).radiance,
        merge_scans([first, (photograph, response)]).radiance,
        rtol=1e-5,
    )


def test_where_both_hold_a_pixel_the_mean_is_eq_6_s():
    step = 0.02
    coarse = Response(np.tile(np.arange(256) * step, (3, 1)), np.full(3, 0.5))
    fine = Response(np.tile(np.arange(256) * step / 2, (3, 1)), np.full(3, 0.5))
    values = np.tile(80 + 3 * np.arange(20), (12, 1))
    one = Photograph(np.repeat(values[..., None], 3, 2).astype(np.uint8), "one", TAKEN)
    # The fine scan says the same of every pixel but for one that is 10 values, 0.1 of ln exposure, higher.
    other = np.repeat((2 * values - 100)[..., None], 3, 2).astype(np.uint8)
    other[5, 10] += 10
    merged = merge_scans([(one, coarse), (Photograph(other, "other", TAKEN), fine)])
    alone = single(one, coarse)
    # Half the slope is a quarter of the variance: weights 1 and 4.
    assert np.log(merged.radiance[5, 10] / alone.radiance[5, 10]) == pytest.approx([0.08] * 3, abs=1e-3)
    assert np.log(merged.radiance[5, 9] / alone.radiance[5, 9]) == pytest.approx([0.0] * 3, abs=1e-3)
    assert merged.variance is not None
    relative = merged.variance[5, 9] / merged.radiance[5, 9] ** 2
    assert relative == pytest.approx([(0.5 * step) ** 2 / 5] * 3, rel=1e-4)


def test_what_no_scan_holds_is_marked_and_bounded():
    exposure = negative()
    exposure[:, :3] = np.exp(-12.0)
    exposure[:, -3:] = np.exp(8.0)
    merged = merge_scans(scanned(exposure))
    assert merged.clipped is not None and merged.variance is not None
    assert (merged.clipped[:, :3] == BLACK).all() and (merged.clipped[:, -3:] == SATURATED).all()
    assert (merged.clipped[:, 30:130] == 0).all()
    assert np.isinf(merged.variance[:, :3]).all() and np.isinf(merged.variance[:, -3:]).all()
    # Bounds: no darker pixel than the darkest value of the shadows' scan, none brighter than white in the lights'.
    measured = merged.radiance[np.isfinite(merged.variance)]
    assert merged.radiance[:, :3].max() < measured.min() and merged.radiance[:, -3:].min() > measured.max()


def test_pixels_outside_count_nowhere():
    scans = both()
    outside = np.zeros((120, 160), bool)
    outside[:20] = True
    broken = scans[1][0].pixels.copy()
    broken[:20] = 255
    scans[1] = (replace(scans[1][0], pixels=broken, outside=outside), scans[1][1])
    merged = merge_scans(scans)
    first = single(*scans[0])
    held = np.isfinite(first.variance[:20])  # type: ignore[index]
    np.testing.assert_allclose(merged.radiance[:20][held], first.radiance[:20][held], rtol=1e-5)
    nowhere = [(replace(p, outside=outside), r) for p, r in scans]
    result = merge_scans(nowhere)
    assert result.clipped is not None and result.variance is not None
    assert (result.clipped[:20] == OUTSIDE).all() and not (result.clipped[20:] == OUTSIDE).any()
    assert result.radiance[:20].max() == 0 and np.isinf(result.variance[:20]).all()


def test_one_scan_is_a_single_photograph():
    scan = both()[0]
    alone, merged = single(*scan), merge_scans([scan])
    np.testing.assert_allclose(merged.radiance, alone.radiance, rtol=1e-6)
    np.testing.assert_allclose(merged.variance, alone.variance, rtol=1e-5)  # type: ignore[arg-type]
    np.testing.assert_array_equal(merged.clipped, alone.clipped)  # type: ignore[arg-type]


def test_one_photograph_through_a_known_response_is_a_radiance_map(calibration):
    scene, exposure = wide_scene(96, 64, stops=5.0, brightest=4.0), Exposure(0.1, 2.0, 400.0)
    picture = single(NOISELESS.photograph(scene, exposure), calibration.response)
    assert picture.variance is not None
    held = np.isfinite(picture.variance) & (picture.radiance > 0)
    assert held.mean() > 0.5
    error = np.log(picture.radiance / scene)
    for channel in range(3):
        one = error[..., channel][held[..., channel]]
        assert np.median(np.abs(one - np.median(one))) < 0.006


def test_the_response_of_each_setting_is_recovered_from_a_bracket_scanned_at_it():
    # As the paper outlines: the camera takes a bracket, both settings scan every negative of it.
    scene = wide_scene(96, 72, stops=5.0, brightest=0.5)
    times = [4.0**k for k in range(-4, 3)]
    responses = []
    for scanner in (SHADOWS, LIGHTS):
        frames = [scanner.scan(scene * t, seed=i, name=f"{i}.tif", taken=Exposure(t)) for i, t in enumerate(times)]
        responses.append(recover_response(Bracket(tuple(frames))).response)
    photographs = scanned(negative(), 50)
    merged = merge_scans([(scan, response) for (scan, _), response in zip(photographs, responses, strict=True)])
    assert merged.variance is not None
    for channel in range(3):
        where = np.isfinite(merged.variance[..., channel])
        assert where.mean() > 0.8
        error = np.log(merged.radiance[..., channel][where] / negative()[..., channel][where])
        assert np.median(np.abs(error - np.median(error))) < 0.03


def test_the_paper_s_weights_combine_as_well():
    merged = merge_scans(both(), weighting=Hat())
    assert merged.variance is not None
    where = np.isfinite(merged.variance[..., 1])
    error = np.log(merged.radiance[..., 1][where] / negative()[..., 1][where])
    assert np.median(np.abs(error - np.median(error))) < 0.02


def test_scans_that_do_not_belong_together_are_refused():
    (first, response), (second, other) = both()
    with pytest.raises(NotABracket, match="different exposures, so they are no scans of one negative"):
        merge_scans([(first, response), (replace(second, exposure=Exposure(2.0)), other)])
    with pytest.raises(NotABracket, match=r"scan_1\.tif is 10×120, scan_0\.tif is 160×120"):
        merge_scans([(first, response), (replace(second, pixels=second.pixels[:, :10]), other)])
    with pytest.raises(NotABracket, match="no exposure is known; give that of the negative"):
        merge_scans([(first, response), (replace(second, exposure=None), other)])
    with pytest.raises(NotABracket, match="pixels of red in common; scan at density settings that overlap"):
        apart = Scanner(0.1, 1.0), Scanner(2.0, 2.9)
        merge_scans([(s.scan(negative()), s.response()) for s in apart])
    with pytest.raises(NotABracket, match="uint8 pixels and a response of 300 values; it needs a response of 256"):
        merge_scans([(first, Response(np.tile(np.arange(300.0), (3, 1)), np.ones(3)))])
    with pytest.raises(NotABracket, match="no scans were given"):
        merge_scans([])


def test_scans_that_are_not_in_register_are_reported():
    texture = np.exp(np.random.default_rng(3).uniform(-7, 1, (60, 80, 1))) * np.ones(3)
    scans = scanned(texture)
    merge_scans(scans)
    moved = replace(scans[1][0], pixels=np.roll(scans[1][0].pixels, 2, axis=1))
    with pytest.warns(UserWarning, match=r"scan_0\.tif and scan_1\.tif disagree by .*; register the scans"):
        merge_scans([scans[0], (moved, scans[1][1])])


def test_scans_are_merged_from_files_by_the_profiles_of_their_settings(tmp_path):
    exposure = np.geomspace(0.002, 5, 64 * 48).reshape(48, 64, 1) * np.ones(3)
    scanners = [Scanner(0.1, 1.4), Scanner(1.0, 2.6)]
    scans, profiles = [], []
    for index, scanner in enumerate(scanners):
        scans.append(tmp_path / f"scan_{index}.png")
        write(scans[-1], replace(scanner.scan(exposure, seed=index), exposure=None))
        profiles.append(tmp_path / f"setting_{index}.json")
        write_profile(profiles[-1], CameraProfile("scanner", scanner.response()))
    made = merge_scan_files(scans, profiles, seconds=0.5)
    pairs = [(replace(read_photograph(scan), exposure=Exposure(0.5)), scanner.response())
             for scan, scanner in zip(scans, scanners, strict=True)]  # fmt: skip
    assert np.array_equal(made.radiance, merge_scans(pairs).radiance)
    # A negative exposed twice as long had half the radiance.
    np.testing.assert_allclose(made.radiance, 2 * merge_scan_files(scans, profiles).radiance, rtol=1e-5)
    with pytest.raises(NotABracket, match="2 scans and 1 profiles; give one a scan"):
        merge_scan_files(scans, profiles[:1])
