"""Finding mirrored balls in pictures that nobody tuned to: the kinds of `ball_finding.py` with other numbers.

    python benchmarks/ball_finding_held_out.py [--kinds crops,stands] [--every 4] [--verbose]

Other photographs of the sets, other maps, sizes, margins, turns, blurs, stands, exposures and places than those of
`ball_finding.py`, and other pictures without a ball. The method is improved on the former's misses and never on these;
what is found here says whether it holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import cv2
import numpy as np
from ball_finding import (
    CHROME_STEEL,
    MAPS,
    THINGS,
    Case,
    about_the_ball,
    base,
    cropped,
    exposed_to_eight_bits,
    inside,
    main,
    photograph,
    put,
    rotated,
    scaled,
    traced_balls,
    with_stand,
)

BASES = (
    "data/ball/pietka_room/raw1.jpg",
    "data/ball/uiuc_desk/0120.jpg",
    "data/ball/xu_bracket5/cp_t40.jpg",
    "shoots/room/ball_90/IMG_0005.jpg",
)
OTHER_MAPS = (
    "data/hdri/pmndrs/dawn.exr",
    "data/hdri/pmndrs/night.exr",
    "data/probes/cubes_dds/galileo_cross.dds",
)
WITHOUT = (
    "shoots/room/plate/IMG_0003.jpg",
    "data/brackets/arch_full/img_15.jpg",
    "data/brackets/arch_small/1_4.jpg",
    "data/brackets/ghost_hall/IMG_0961.JPG",
    "data/brackets/ghost_lady/Img3.jpg",
    "data/brackets/room/stack_room_exp_4.jpg",
    "data/brackets/window/1_4.jpg",
)


def bases() -> list[Case]:
    return [base(path) for path in BASES]


def sizes() -> Iterator[Case]:
    for case in bases():
        longer = max(case.picture.shape)
        for side in (50, 80, 130, 320, 1100, 2200):
            assert case.truth is not None
            if case.truth[2] * side / longer > 12:
                yield scaled(case, "sizes", f"{side} px", side / longer)


def crops() -> Iterator[Case]:
    for case in bases():
        assert case.truth is not None
        x, y, r = case.truth
        for margin in (0.7, 0.35, 0.15, 0.05, -0.01, -0.03):
            reach = (1 + margin) * r
            yield cropped(case, "crops", f"margin {margin:g}", x - reach, y - reach, 2 * reach, 2 * reach)
        yield cropped(case, "crops", "left", x - 2.1 * r, y - 1.2 * r, 3.15 * r, 2.3 * r)
        yield cropped(case, "crops", "high", x - 1.4 * r, y - 1.5 * r, 3.0 * r, 2.47 * r)


def rotations() -> Iterator[Case]:
    for case in bases():
        for degrees in (17, 60, 110, -70):
            yield rotated(about_the_ball(case, 2.0), "rotations", degrees)


def blurs() -> Iterator[Case]:
    for case in bases():
        assert case.truth is not None
        for share in (0.0075, 0.015, 0.025, 0.035):
            picture = cv2.GaussianBlur(case.picture, (0, 0), share * case.truth[2])
            yield case.as_("blurs", f"blur {100 * share:g} %", picture, case.truth)
        picture = exposed_to_eight_bits(case.picture, float(np.median(case.picture)), 5, 0.05)
        yield case.as_("blurs", "noise 0.05", picture, case.truth)


def stands() -> Iterator[Case]:
    for case in bases():
        for seed, (hidden, level) in enumerate(((55, 0.5), (85, 2.0), (115, 1.0), (120, 0.3)), 10):
            yield with_stand(about_the_ball(case, 1.5), hidden, seed, level)


def surroundings() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 1.9)
        assert around.truth is not None
        ball = inside(around.picture.shape, around.truth)
        for gain in (0.2, 5.0, 20.0):
            lit = around.picture * (ball + gain * (1 - ball))
            picture = exposed_to_eight_bits(lit, float(np.median(around.picture)) * (1 if gain < 20 else 0.5), 3)
            yield around.as_("surroundings", f"outside ×{gain:g}", picture, around.truth)


def exposures() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 1.8)
        for grey in (0.01, 0.04, 0.35, 0.75):
            picture = exposed_to_eight_bits(around.picture, grey, 9, noise=0.02)
            yield around.as_("exposures", f"median at {grey:g}", picture, around.truth)


def beside() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 3.0)
        assert around.truth is not None
        x, y, r = around.truth
        grey = float(np.median(case.picture))
        for number, (name, maker) in enumerate(THINGS.items()):
            ratio = (1.1, 0.6, 0.9)[number % 3]
            side = 1 if number % 2 else -1
            place = (x + side * (1 + ratio) * r * 1.1, y - 0.15 * r, ratio * r)
            yield around.as_("beside", name, put(around.picture, maker, place, grey), around.truth)


def traced() -> Iterator[Case]:
    """Under maps that the other benchmark has not, and under its own from other places."""
    yield from traced_balls(maps=OTHER_MAPS, seed=21)
    for number, case in enumerate(traced_balls(maps=MAPS, seed=22)):
        if number % 7 < 3:
            yield case


def chrome() -> Iterator[Case]:
    for number, case in enumerate(traced_balls("chrome", CHROME_STEEL, (*OTHER_MAPS, *MAPS), 23)):
        if number % 3 == 0:
            yield case


def nothing() -> Iterator[Case]:
    """Other pictures without a mirrored ball, and things in them."""
    for path in WITHOUT:
        picture = photograph(path)
        yield Case("nothing", path.split("/", 1)[1], picture, None)
        left = picture[picture.shape[0] // 3 :, : picture.shape[1] // 2]
        yield Case("nothing", f"{path.split('/', 1)[1]} part", np.ascontiguousarray(left), None)
    for number, path in enumerate(WITHOUT[1:3]):
        ground = cv2.resize(photograph(path), (800, 600), interpolation=cv2.INTER_AREA)
        for name, maker in THINGS.items():
            picture = put(ground, maker, (360.0, 320.0, (95.0, 150.0)[number]), float(np.median(ground)))
            yield Case("nothing", f"{name} in {path.rsplit('/', 1)[1]}", picture, None)


def two() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 1.2)
        picture = np.concatenate([around.picture, around.picture[::-1]], axis=0)
        yield replace(around, kind="two", picture=np.ascontiguousarray(picture), truth=None)


KINDS: dict[str, Callable[[], Iterator[Case]]] = {
    "sizes": sizes, "crops": crops, "rotations": rotations, "blurs": blurs, "stands": stands,
    "surroundings": surroundings, "exposures": exposures, "beside": beside, "traced": traced, "chrome": chrome,
    "nothing": nothing, "two": two,
}  # fmt: skip

if __name__ == "__main__":
    main(KINDS)
