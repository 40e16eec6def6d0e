"""Response curves that other programs wrote: pfstools, Luminance HDR, hdrgen, and plain tables."""

from __future__ import annotations

import re

import numpy as np

from relume.image.response import Response

ROUNDING = 12**-0.5
"""Standard deviation of a pixel value from rounding alone: such files say nothing of noise."""


def read_curves(text: str, name: str) -> Response:
    """The response in `text`, whichever of the known forms it has.

    name : of the file, for messages
    pfstools writes one Octave matrix a channel ("# name: IR") with rows of log10 response, value, response;
        Luminance HDR one of seven columns, value and log10 and response of each channel; hdrgen one line a channel,
        a polynomial's order and its coefficients from the highest, of the value over 255; a table has 256 or 65536
        rows of one exposure or of one a channel, after the value itself or without it
    Raises ValueError for anything else.
    """
    if "# columns:" in text:
        return _octave(text, name)
    lines = [line for line in (raw.split("#")[0].strip() for raw in text.splitlines()) if line]
    try:
        rows = [[float(word) for word in re.split(r"[\s,;]+", line.strip(",;"))] for line in lines]
    except ValueError:
        raise ValueError(
            f"{name}: not a response curve; expected relume's JSON, pfstools' .m, hdrgen's .rsp or a table"
        ) from None
    if len(rows) in (1, 3) and all(len(row) >= 3 and row[0] == len(row) - 2 for row in rows):
        curves = [np.polyval(row[1:], np.arange(256) / 255) for row in rows]
        return _response(np.stack(curves * (3 // len(curves))), name)
    return _table(rows, name)


def _octave(text: str, name: str) -> Response:
    blocks = re.split(r"#\s*columns:\s*", text)[1:]
    tables = []
    for block in blocks:
        head, _, body = block.partition("\n")
        # The comments before the next matrix belong to it.
        rows = [line.split() for line in body.splitlines() if line.strip() and not line.lstrip().startswith("#")]
        try:
            table = np.array(rows, np.float64)
        except ValueError:
            table = np.zeros((0, 0))
        if table.ndim != 2 or not head.strip().isdigit() or table.shape[1] != int(head) or len(table) == 0:
            raise ValueError(f"{name}: its matrix is not rows of {head.strip()} numbers; the file is damaged")
        tables.append(table)
    if len(tables) == 1 and tables[0].shape[1] == 7:
        return _response(tables[0][:, [2, 4, 6]].T, name)
    # The weights that pfstools saves as well have two columns.
    curves = [table[np.argsort(table[:, 1]), 2] for table in tables if table.shape[1] == 3]
    if len(curves) not in (1, 3) or len({len(curve) for curve in curves}) != 1:
        raise ValueError(f"{name}: {len(curves)} curves; expected one for all channels or one for each of three")
    return _response(np.stack(curves * (3 // len(curves))), name)


def _table(rows: list[list[float]], name: str) -> Response:
    widths = {len(row) for row in rows}
    if len(rows) not in (256, 65536) or len(widths) != 1 or not widths <= {1, 2, 3, 4}:
        raise ValueError(
            f"{name}: {len(rows)} rows of {'/'.join(map(str, sorted(widths)))} numbers; "
            "a table of a response has 256 rows of one exposure or of three"
        )
    table = np.array(rows)
    if table.shape[1] in (2, 4):
        if not np.array_equal(table[:, 0], np.arange(len(table))):
            raise ValueError(f"{name}: its first column is not the pixel values from 0; expected value and exposure")
        table = table[:, 1:]
    return _response(np.repeat(table, 3 // table.shape[1], axis=1).T, name)


def _response(exposure: np.ndarray, name: str) -> Response:
    """A response from exposures (3, levels); those that are not positive, at the dark end, go on towards black."""
    curves = []
    for channel in exposure:
        positive = np.flatnonzero(channel > 0)
        if not np.all(np.isfinite(channel)) or len(positive) < len(channel) // 2:
            raise ValueError(f"{name}: most of its exposures are not positive; it is no response curve")
        # The last stretch that rises to white; before it a polynomial may have turned or fallen below 0.
        falls = np.flatnonzero((np.diff(channel) < 0) | (channel[:-1] <= 0))
        first = int(falls[-1]) + 1 if len(falls) else 0
        if first > len(channel) // 8:
            raise ValueError(f"{name}: its exposure falls from value {first - 1} to {first}; a response rises")
        curve = np.log(np.maximum(channel, channel[first]))
        place = np.log(np.maximum(np.arange(len(channel)), 0.5))
        beyond = min(first + max(8, len(channel) // 32), len(channel) - 1)
        slope = max((curve[beyond] - curve[first]) / (place[beyond] - place[first]), 1e-3)
        curve[:first] = curve[first] + slope * (place[:first] - place[first])
        curves.append(curve + 1e-9 * np.arange(len(channel)))
    log_exposure = np.stack(curves)
    middle = (log_exposure.shape[1] - 1) // 2
    return Response(log_exposure - log_exposure[:, middle : middle + 1], np.full(3, ROUNDING))
