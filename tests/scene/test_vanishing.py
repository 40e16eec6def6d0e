"""The camera from lines along the world's axes: a box seen by a known camera gives the camera back."""

import json
from dataclasses import replace

import numpy as np
import pytest

from angles import degrees_turned
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.known_lengths import CameraHeight, GroundLength, UprightLength
from relume.scene.cameras.vanishing_lines import AxisLines, fit_vanishing_lines

SIZE = (1200, 800)
BOX = np.array([0.3, 0.25, 0.4])  # its corner at the origin, its edges along the axes
CAMERA = Camera.looking_at(
    np.array([1.0, 0.8, 1.4]), np.array([0.15, 0.1, 0.2]), width=1200, height=800, focal_length=1400
)


def edges(camera, axis, noise=None):
    """The box's four edges along an axis (4, 2, 2), pixels, as a person draws them."""
    others = [i for i in range(3) if i != axis]
    starts = np.zeros((4, 3))
    starts[:, others] = np.array([[0, 0], [0, 1], [1, 0], [1, 1]]) * BOX[others]
    ends = starts + np.eye(3)[axis] * BOX[axis]
    drawn = np.stack([camera.project(starts), camera.project(ends)], axis=1)
    return drawn if noise is None else drawn + noise.normal(0, 0.3, drawn.shape)


def drawn(camera, axes, noise=None, level=False):
    return AxisLines(**{axis: edges(camera, "xyz".index(axis), noise) for axis in axes}, level=level)


def at(camera, *point):
    x, y = camera.project(np.array(point, float))
    return (float(x), float(y))


def fitted(camera, lines, length=None, **lens):
    length = length or GroundLength(at(camera, BOX[0], 0, 0), at(camera, 0, 0, BOX[2]), 0.5)  # 3, 4, 5
    return fit_vanishing_lines(SIZE, lines, origin=at(camera, 0, 0, 0), length=length, **lens)


def turn_between(first, second):
    return degrees_turned(first.rotation, second.rotation)


@pytest.mark.parametrize(
    ("axes", "given"),
    [
        ("xyz", {}), ("xz", {}), ("xy", {}), ("yz", {}),
        ("xz", {"focal_length": 1400.0}),
        ("xyz", {"estimate_centre": True}),
        ("x", {"focal_length": 1400.0, "level": True}),
        ("z", {"focal_length": 1400.0, "level": True}),
    ],
)  # fmt: skip
def test_exact_lines_give_back_the_camera(axes, given):
    given = dict(given)
    fit = fitted(CAMERA, drawn(CAMERA, axes, level=given.pop("level", False)), **given)
    assert fit.camera.focal_length == pytest.approx(1400, rel=1e-7)
    assert np.linalg.norm(fit.camera.position - CAMERA.position) < 1e-7 and turn_between(fit.camera, CAMERA) < 1e-5
    assert fit.residual is not None and fit.residual < 1e-6 and len(fit.points) == 8 * len(axes)


def test_noise_of_a_third_of_a_pixel_moves_the_camera_by_as_much_as_lines_allow():
    misses, turns, residuals, noise = [], [], [], np.random.default_rng(1)
    for _ in range(20):
        fit = fitted(CAMERA, drawn(CAMERA, "xyz", noise))
        misses.append(np.linalg.norm(fit.camera.position - CAMERA.position))
        turns.append(turn_between(fit.camera, CAMERA))
        residuals.append(fit.residual)
    # Ends 0.3 px off lines of 250 px turn them by 1.7 mrad; four a set, three sets: about 0.05°, and 1.9 m · 1 mrad.
    assert np.sqrt(np.mean(np.square(turns))) < 0.15 and np.sqrt(np.mean(np.square(misses))) < 0.02
    # Of a line's two ends only half of what is across it remains, less the 4 unknowns of 12 lines: 0.3·√(½·8/12).
    assert np.sqrt(np.mean(np.square(residuals))) == pytest.approx(0.3 * np.sqrt(0.5 * 8 / 12), rel=0.25)


def test_offsets_lead_from_the_ends_to_lines_that_meet_in_one_point():
    fit = fitted(CAMERA, drawn(CAMERA, "xz", np.random.default_rng(2)))
    straight = (fit.points + fit.offsets).reshape(2, 4, 2, 2)
    for direction, lines in zip(np.eye(3)[[0, 2]], straight, strict=True):
        ahead = direction * np.sign(-fit.camera.rotation[:, 2] @ direction)
        point = fit.camera.project(fit.camera.position + 1e6 * ahead)
        along, towards = lines[:, 1] - lines[:, 0], point - lines[:, 0]
        crossed = along[:, 0] * towards[:, 1] - along[:, 1] * towards[:, 0]
        assert np.abs(crossed / np.linalg.norm(along, axis=-1) / np.linalg.norm(towards, axis=-1)).max() < 1e-6
    assert fit.worst is not None and 0 < fit.worst < 1.5


def test_the_order_of_ends_and_lines_does_not_matter():
    lines = drawn(CAMERA, "xz")
    x, _, z = lines.segments()
    turned = AxisLines(x=x[::-1, ::-1], z=np.concatenate([z[2:], z[:2, ::-1]]))
    one, other = fitted(CAMERA, lines).camera, fitted(CAMERA, turned).camera
    np.testing.assert_allclose(one.position, other.position, atol=1e-9)


@pytest.mark.parametrize(
    ("position", "target"),
    [
        ((-1.0, 0.5, 1.2), (0.1, 0.1, 0.1)),
        ((0.9, 1.9, 0.9), (0.1, 0.0, 0.1)),  # steeply down
        ((0.4, 0.1, 2.0), (0.1, 0.2, 0.0)),  # slightly up
        ((0.15, 2.0, 0.2001), (0.15, 0.0, 0.2)),  # straight down, as from a ladder
    ],
)
def test_the_frame_has_x_to_the_right_and_y_up_wherever_the_camera_stands(position, target):
    camera = Camera.looking_at(np.array(position), np.array(target), width=1200, height=800, focal_length=1400)
    fit = fitted(camera, drawn(camera, "xyz"), focal_length=1400.0)
    assert np.linalg.norm(fit.camera.position - camera.position) < 1e-7 and turn_between(fit.camera, camera) < 1e-5


def test_a_view_along_an_axis_needs_the_focal_length_and_then_finds_the_camera():
    # One-point perspective: lines along x and y stay parallel in the photograph.
    camera = Camera(1200, 800, 1400.0, np.array([0.2, 0.4, 2.0]), np.eye(3))
    with pytest.raises(ValueError, match=r"give focal_length") as caught:
        fitted(camera, drawn(camera, "xz"))
    assert "\n" not in str(caught.value)
    fit = fitted(camera, drawn(camera, "xz"), focal_length=1400.0)
    assert np.linalg.norm(fit.camera.position - camera.position) < 1e-6
    assert fit.worst is not None and fit.worst < 1e-6


def test_one_set_and_one_upright_line_are_enough_with_the_focal_length():
    rolled = replace(CAMERA, rotation=CAMERA.rotation @ np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1.0]]))
    lines = AxisLines(x=edges(rolled, 0), y=edges(rolled, 1)[:1])
    fit = fitted(rolled, lines, focal_length=1400.0)
    assert turn_between(fit.camera, rolled) < 1e-5
    with pytest.raises(ValueError, match="lines along x alone do not determine how"):
        fitted(rolled, AxisLines(x=edges(rolled, 0)), focal_length=1400.0)


def test_a_cropped_photograph_says_its_principal_point():
    camera = replace(CAMERA, centre=(700.0, 330.0))
    fit = fitted(camera, drawn(camera, "xyz"), estimate_centre=True)
    assert fit.camera.centre == pytest.approx((700, 330), abs=1e-4)
    given = fitted(camera, drawn(camera, "xz"), centre=(700.0, 330.0))
    assert given.camera.focal_length == pytest.approx(1400, rel=1e-7)


def test_lines_behind_a_distorting_lens_are_straightened():
    camera = replace(CAMERA, distortion=Distortion(k1=-0.2, p1=0.002))
    fit = fitted(camera, drawn(camera, "xyz"), focal_length=1400.0, distortion=camera.distortion)
    assert np.linalg.norm(fit.camera.position - camera.position) < 1e-7 and fit.camera.distortion == camera.distortion
    far = AxisLines(x=[*edges(camera, 0), [[600, 400], [9000, 9000]]], z=edges(camera, 2))
    with pytest.raises(ValueError, match="a line ends where the distortion has folded over"):
        fitted(camera, far, focal_length=1400.0, distortion=camera.distortion)
    blind = fitted(camera, drawn(camera, "xyz"), focal_length=1400.0)
    assert np.linalg.norm(blind.camera.position - camera.position) > 0.005


@pytest.mark.parametrize(
    "length",
    [
        GroundLength(at(CAMERA, 0.1, 0, 0), at(CAMERA, 0.1, 0, 0.4), 0.4),
        UprightLength(at(CAMERA, 0.3, 0, 0.4), at(CAMERA, 0.3, 0.25, 0.4), 0.25),
        CameraHeight(0.8),
    ],
)
def test_any_known_length_gives_the_size(length):
    fit = fitted(CAMERA, drawn(CAMERA, "xz"), length)
    assert np.linalg.norm(fit.camera.position - CAMERA.position) < 1e-7


def test_a_real_room_comes_back_from_lines_along_its_box(shared):
    """Lines along the true edges of the table's grid and the room, to whole pixels as a person clicks them."""
    truth = json.loads((shared / "shoots/room/truth/shoot.json").read_text())["plate_camera"]
    ours = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    placed = np.array(truth["matrix_world"])
    focal_length = truth["width"] / 2 / np.tan(np.radians(truth["hfov_deg"]) / 2)
    true = Camera(768, 512, focal_length, ours @ placed[:3, 3], ours @ placed[:3, :3])
    along_x = [[at(true, -0.3, 0, z), at(true, 0.3, 0, z)] for z in np.linspace(-0.3, 0.3, 4)]
    along_z = [[at(true, x, 0, -0.3), at(true, x, 0, 0.3)] for x in np.linspace(-0.3, 0.3, 4)]
    lines = AxisLines(x=np.rint(along_x), z=np.rint(along_z))
    fit = fit_vanishing_lines(
        (768, 512), lines, origin=at(true, 0, 0, 0), length=CameraHeight(0.55), focal_length=focal_length
    )
    assert np.linalg.norm(fit.camera.position - true.position) < 0.02 and turn_between(fit.camera, true) < 0.5
    assert fit.residual is not None and 0 < fit.residual < 0.5  # rounding moves an end by ⅓ pixel


@pytest.mark.parametrize(
    ("lines", "given", "message"),
    [
        (lambda: AxisLines(), {}, "do not determine the focal length"),
        (lambda: AxisLines(), {"focal_length": 1400.0}, "no two lines along any axis"),
        (lambda: drawn(CAMERA, "x"), {}, "do not determine the focal length"),
        (lambda: AxisLines(x=[edges(CAMERA, 0)[0]] * 2, z=edges(CAMERA, 2)), {}, "lines.x lie all on one line"),
        (lambda: drawn(CAMERA, "xz"), {"estimate_centre": True}, "needs two lines or more along each of x, y and z"),
        (lambda: drawn(CAMERA, "xz"), {"distortion": Distortion(k1=-0.1)}, "give focal_length as well"),
        (
            lambda: AxisLines(y=edges(CAMERA, 0), x=edges(CAMERA, 1)),
            {},
            r"origin 595, 387 lies above the horizon.*check which axis each line was drawn along",
        ),
    ],
)
def test_lines_that_say_no_camera_are_refused_in_one_line(lines, given, message):
    with pytest.raises(ValueError, match=message) as caught:
        fitted(CAMERA, lines(), **given)
    assert "\n" not in str(caught.value)


def test_lines_that_are_no_lines_are_refused():
    with pytest.raises(ValueError, match=r"lines\.x are \(2, 4\); expected \(N, 2, 2\)"):
        AxisLines(x=np.zeros((2, 4)))
    with pytest.raises(ValueError, match=r"lines\.z\.1 is shorter than 2 pixels"):
        AxisLines(z=[[[0, 0], [9, 0]], [[5, 5], [6, 5]]])


def test_lengths_that_say_no_size_are_refused():
    lines, above = drawn(CAMERA, "xz"), (600.0, -3000.0)
    with pytest.raises(ValueError, match="lies above the horizon"):
        fitted(CAMERA, lines, GroundLength(at(CAMERA, 0, 0, 0), above, 1.0))
    with pytest.raises(ValueError, match="lies below its foot"):
        fitted(CAMERA, lines, UprightLength(at(CAMERA, 0, 0, 0), at(CAMERA, 0, -0.1, 0), 0.1))
    with pytest.raises(ValueError, match=r"origin .* lies above the horizon"):
        fit_vanishing_lines(SIZE, lines, origin=above, length=CameraHeight(1.0))
    with pytest.raises(ValueError, match="less than 2 pixels apart"):
        GroundLength((1, 1), (2, 1), 1.0)
    with pytest.raises(ValueError, match="camera height of 0"):
        CameraHeight(0.0)
