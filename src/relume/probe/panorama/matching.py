"""What two views of a panorama have in common: features matched, and the turn between them that most agree with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.image.colour import luminance
from relume.probe.panorama.views import PanoramaView
from relume.sphere.directions import angle_between, normalised

STOPS = 8.0
"""Range of the logarithmic picture in which features are looked for, about its median."""
BORDER = 6
"""Pixels along the rim in which no feature is looked for: the rim itself would be one."""
APART = np.radians(2)
"""Two features nearer to each other than this do not determine a turn."""
TRIES = 600
"""Pairs of matches that are tried for a turn; half the matches may be wrong, and one try in four then is right."""


@dataclass(frozen=True)
class Matching:
    """How features are found and matched.

    width : pixels that the longer side is shrunk to; at 1200 a feature is known to a hundredth of a degree or two
    features : of a view, at most, the strongest
    ratio : of the distances to the best and second best descriptor, above which a match is doubted (Lowe 2004, §7.1)
    tolerance : radians that right matches may disagree by while the focal length is only roughly known
    least : matches that have to agree for two views to be taken for neighbours
    distortion : whether one radial term of the lens is found, too
    level : whether the horizon is found from the views; otherwise the first view keeps its frame
    seed : of the random tries
    """

    width: int = 1200
    features: int = 2500
    ratio: float = 0.75
    tolerance: float = 0.02
    least: int = 14
    distortion: bool = True
    level: bool = True
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Features:
    """Features of one view.

    points : (N, 2) pixel coordinates in the view's picture
    descriptors : (N, 128) float32
    scale : pixels of the picture for one of the picture they were found in
    """

    points: np.ndarray
    descriptors: np.ndarray
    scale: float


@dataclass(frozen=True, eq=False)
class Pair:
    """Two views that show the same: their matches.

    first, second : indices of the views
    points : (N, 2, 2) pixel coordinates in the first and in the second
    rotation : (3, 3) first-from-second, of the cameras' frames
    agreeing : (N,) bool, the matches that the rotation explains
    """

    first: int
    second: int
    points: np.ndarray
    rotation: np.ndarray
    agreeing: np.ndarray


def features_of(view: PanoramaView, method: Matching = Matching()) -> Features:
    """The features of a view (Lowe 2004), found in a stereographic picture of its logarithm.

    That projection keeps angles, so that what stands in the corner of one view and in the middle of another looks alike
    but for its size; a logarithm, so that exposure does not matter.
    """
    import cv2

    shrink = min(1.0, method.width / max(view.picture.size))
    light = np.maximum(luminance(view.picture.radiance), 0).astype(np.float32)
    if shrink < 1:
        light = cv2.resize(light, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    shrinks = np.array([light.shape[1], light.shape[0]]) / view.picture.size
    focal_length = view.focal_length * shrinks[0]
    values = in_stops(light)
    # Every pixel of the stereographic picture looked up in the perspective one.
    corner = view.rays(np.array([[0.0, 0.0]]))[0]
    reach = 2 * np.tan(np.arctan2(np.hypot(corner[0], corner[1]), -corner[2]) / 2) / np.hypot(corner[0], corner[1])
    across, up = (int(np.ceil(abs(reach * focal_length * c))) for c in corner[:2])
    # The sides bulge beyond the corners.
    sides = 2 * np.tan(np.arctan(np.array(view.picture.size) / 2 / view.focal_length) / 2) * focal_length
    half = [max(a, int(np.ceil(b))) for a, b in zip((across, up), sides, strict=True)]
    x, y = np.meshgrid(np.arange(-half[0], half[0] + 1), np.arange(-half[1], half[1] + 1))

    def bent(flat: np.ndarray) -> np.ndarray:
        """Pixels of the view at places of the stereographic plane."""
        straight = _perspective(flat)
        square = (straight**2).sum(-1, keepdims=True)
        return straight * (1 + view.distortion * square) * view.focal_length + np.array(view.picture.size) / 2

    place = (bent(np.stack([x, y], -1) / focal_length) * shrinks - 0.5).astype(np.float32)
    picture = cv2.remap(values, place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inside = (place >= BORDER) & (place <= np.array(light.shape[::-1]) - 1 - BORDER)
    mask = np.where(inside.all(-1), 255, 0).astype(np.uint8)
    found, descriptors = described(picture, mask, method.features)
    return Features(bent((found - np.array(half)) / focal_length), descriptors, float(1 / shrinks[0]))


def in_stops(light: np.ndarray) -> np.ndarray:
    """Luminance (H, W) as values from 0 to 255, linear in stops about its median."""
    lit = light[light > 0]
    middle = float(np.median(lit)) if lit.size else 1.0
    stops = np.log2(np.maximum(light, middle * 2.0 ** (-STOPS))) - np.log2(middle)
    return np.clip(127.5 + 255 / STOPS * stops, 0, 255).astype(np.float32)


def described(picture: np.ndarray, mask: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 2) of a picture's features, x and y from the middle of its first pixel, and descriptors (N, 128).

    picture : (H, W) from 0 to 255; mask : (H, W) uint8, 255 where features are looked for; count : at most
    """
    import cv2

    # Without the last word OpenCV gives places a quarter of a pixel beside.
    finder = cv2.SIFT.create(nfeatures=count, contrastThreshold=0.02, enable_precise_upscale=True)
    found, descriptors = finder.detectAndCompute(np.rint(picture).astype(np.uint8), mask)
    if descriptors is None or not found:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    return np.array([point.pt for point in found]), np.asarray(descriptors, np.float32)


def _perspective(flat: np.ndarray) -> np.ndarray:
    """Tangents (…, 2) of points (…, 2) of the stereographic plane of focal length 1: r = 2 tan(θ/2)."""
    quarter = (flat**2).sum(-1, keepdims=True) / 4
    return flat / np.maximum(1 - quarter, 1e-3)


def match(first: Features, second: Features, ratio: float) -> np.ndarray:
    """Indices (N, 2) of features that are each other's clear best."""
    import cv2

    if min(len(first.points), len(second.points)) < 2:
        return np.zeros((0, 2), int)
    found = cv2.BFMatcher(cv2.NORM_L2).knnMatch(first.descriptors, second.descriptors, k=2)
    clear = [
        (best.queryIdx, best.trainIdx, best.distance) for best, next_ in found if best.distance < ratio * next_.distance
    ]
    # Of several that found the same partner the nearest is kept.
    kept: dict[int, tuple[int, float]] = {}
    for query, partner, distance in clear:
        if partner not in kept or distance < kept[partner][1]:
            kept[partner] = (query, distance)
    return np.array([(query, partner) for partner, (query, _) in kept.items()], int).reshape(-1, 2)


def find_pairs(views: Sequence[PanoramaView], method: Matching = Matching()) -> list[Pair]:
    """All pairs of views that show the same, each with the turn between them."""
    features = [features_of(view, method) for view in views]
    pairs = []
    for second in range(1, len(views)):
        for first in range(second):
            matches = match(features[first], features[second], method.ratio)
            if len(matches) < method.least:
                continue
            points = np.stack([features[first].points[matches[:, 0]], features[second].points[matches[:, 1]]], axis=1)
            a, b = views[first].rays(points[:, 0]), views[second].rays(points[:, 1])
            rotation, agreeing = most_agreed_rotation(
                a, b, method.tolerance, np.random.default_rng([method.seed, first, second])
            )
            # Brown & Lowe (2007), eq. 13, with a higher least, for repeated windows and tiles agree by chance.
            if agreeing.sum() > max(method.least, 8 + 0.3 * _in_both(views[first], views[second], a, b, rotation)):
                pairs.append(Pair(first, second, points, rotation, agreeing))
    return pairs


def _in_both(first: PanoramaView, second: PanoramaView, a: np.ndarray, b: np.ndarray, rotation: np.ndarray) -> int:
    """How many matches lie where, by this rotation, both views look: only there should they agree."""
    inside = []
    for view, turn, rays in ((first, np.eye(3), b @ rotation.T), (second, rotation, a)):
        points = replace(view, rotation=turn).points(rays)
        with np.errstate(invalid="ignore"):
            inside.append(np.all((points >= 0) & (points <= np.array(view.picture.size)), axis=-1))
    return int((inside[0] & inside[1]).sum())


def most_agreed_rotation(
    a: np.ndarray, b: np.ndarray, tolerance: float, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The rotation that lays most of unit vectors b (N, 3) on a (N, 3) within `tolerance` radians, and which those are.

    Random pairs of matches are tried (Fischler & Bolles 1981); the best is fitted to all that agree with it.
    """
    i, j = generator.integers(0, len(a), (2, TRIES))
    between_a, between_b = (angle_between(v[i], v[j]) for v in (a, b))
    sound = (between_a > APART) & (np.abs(between_a - between_b) < 2 * tolerance)
    i, j = i[sound], j[sound]
    if not len(i):
        return np.eye(3), np.zeros(len(a), bool)
    rotations = _frames(a[i], a[j]) @ np.swapaxes(_frames(b[i], b[j]), 1, 2)
    laid = np.einsum("hij,nj->hni", rotations, b)
    near = np.linalg.norm(laid - a, axis=-1) < tolerance
    best = near[near.sum(1).argmax()]
    rotation = np.eye(3)
    for _ in range(4):
        if best.sum() < 2:
            break
        rotation = fitted_rotation(a[best], b[best])
        best = np.linalg.norm(b @ rotation.T - a, axis=-1) < tolerance
    return rotation, best


def fitted_rotation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation that lays b (N, 3) on a (N, 3) with the least squares (Kabsch 1976)."""
    u, _, vt = np.linalg.svd(a.T @ b)
    return u @ np.diag([1, 1, np.linalg.det(u) * np.linalg.det(vt)]) @ vt


def _frames(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Right-handed frames (N, 3, 3) of pairs of directions: their middle, and what is across."""
    middle = normalised(first + second)
    across = normalised(np.cross(first, second))
    return np.stack([middle, np.cross(across, middle), across], axis=-1)
