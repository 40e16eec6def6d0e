"""Names out of files stay on their line and move no cursor, in errors, warnings and what commands print."""

from __future__ import annotations

import numpy as np
import pytest

from relume.cli import main
from relume.errors import FormatError, NotABracket, RelumeError, UnreadableFile, printable, warn
from relume.image import files
from relume.image.radiance import RadianceMap

HOSTILE = "a\nb\x1b[2J\x07c\u2028d\u202ee\x9bf"


def test_control_characters_line_ends_and_turns_of_direction_become_blanks():
    assert printable(HOSTILE) == "a b [2J c d e f"
    # Letters of all languages, wide blanks and joined emoji stay.
    for text in ("Käfig 1 cm", "写真\u3000館", "\N{WOMAN}\u200d\N{ROCKET}", "±½ − “x”"):
        assert printable(text) == text


def test_no_error_and_no_warning_breaks_its_line():
    errors = [
        UnreadableFile(f"{HOSTILE}: x"),
        FormatError(HOSTILE, "EXR", HOSTILE, HOSTILE, HOSTILE),
        NotABracket(HOSTILE),
    ]
    for error in errors:
        assert isinstance(error, RelumeError) and str(error).isprintable()
    with pytest.warns(UserWarning) as caught:
        warn(HOSTILE)
    assert str(caught[0].message).isprintable()


def test_attributes_and_layers_print_no_control_characters(tmp_path, capsys):
    picture = RadianceMap(np.ones((4, 8, 3), np.float32), attributes={f"na{HOSTILE}me": HOSTILE, "owner": HOSTILE})
    files.write(tmp_path / "a.exr", picture)
    files.write_layers(tmp_path / "b.exr", {"radiance": picture.radiance, f"la{HOSTILE}yer": picture.radiance})
    for words in (["info", "a.exr", "b.exr"], ["convert", "b.exr", "-o", "c.exr"], ["convert", "a.exr", "-o", "c.hdr"]):
        assert main([str(tmp_path / each) if "." in each else each for each in words]) == 0
        printed = capsys.readouterr()
        for line in (printed.out + printed.err).split("\n"):
            assert line.isprintable(), line
