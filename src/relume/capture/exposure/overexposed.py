"""Whether a photograph that is white nearly everywhere shows the scene of a darker one.

Its white hides what the darker one shows, so ranks of all blocks correlate little however right it is. What can be
asked is whether the few places that are not white are the darkest of the darker photograph.
"""

from __future__ import annotations

import numpy as np

from relume.capture.exposure.comparison import SHIFTS, Reduced, coarse_blocks, overlap, ranks_of

WHITE = 0.97
"""Mean pixel value of a block from which on it hides what is there."""
NEARLY = 0.2
"""Share of blocks that are not white, below which a photograph is nearly white: ranks of one scene correlate by 0.43
and more above it, and by 0.2 to 0.6 below."""
STRANGE_WHITE = 0.6
"""What `darkest_alike` gives, below which scenes are different: it is 0.9 and more in the brackets of four made places.
A quarter of pairs from different ones lie above: a ball stands in the middle of every photograph of one."""
FEWEST = 30
"""Blocks that are not white, below which nothing is said: a chair's legs or a person are as many."""


def share_shown(picture: Reduced) -> float:
    """The share of the picture that is not white, 0 to 1."""
    grey, inside = coarse_blocks(picture)
    return float((grey[inside] < WHITE).mean()) if inside.any() else 0.0


def darkest_alike(darker: Reduced, white: Reduced) -> float | None:
    """Whether what is not white in one photograph is what is darkest in the other, −1 to 1; None where too little is.

    The rank-biserial correlation (Mann & Whitney 1947, U; Cureton 1956) at the best small shift: 1 where each block
    that is not white is darker in `darker` than each that is, 0 by chance.
    """
    (grey, inside), (pale, within) = coarse_blocks(darker), coarse_blocks(white)
    if grey.shape != pale.shape:
        return None
    planes, others = np.stack([grey, inside]), np.stack([pale, within])
    best = None
    for down, right in SHIFTS:
        (a, first), (b, second) = overlap(planes, down, right), overlap(others, -down, -right)
        here = (first > 0) & (second > 0)
        shown = b[here] < WHITE
        few, many = int(shown.sum()), int((~shown).sum())
        if few < FEWEST or many < FEWEST or np.ptp(a[here]) == 0:
            continue
        above = ranks_of(a[here])[shown].sum() - few * (few + 1) / 2
        alike = float(1 - 2 * above / (few * many))
        best = alike if best is None else max(best, alike)
    return best
