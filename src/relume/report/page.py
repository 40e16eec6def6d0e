"""A report as one page that holds all it shows, so that it can be sent to a colleague."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

import numpy as np

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1080px; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; } img { width: 100%; display: block; }
figure { margin: 0; } figcaption { color: #555; font-size: 13px; padding: .3rem 0 .8rem; }
.two { display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; }
.three { display: grid; grid-template-columns: repeat(3, 1fr); gap: 1rem; }
.note { background: #fff4d6; padding: .5rem .8rem; border-left: 4px solid #e0a800; margin: .4rem 0; }
.slide { position: relative; } .slide img + img { position: absolute; top: 0; left: 0; clip-path: inset(0 50% 0 0); }
.slide input { width: 100%; } table { border-collapse: collapse; } td { padding: .15rem 1rem .15rem 0; }
th { text-align: left; padding: .15rem 1rem .15rem 0; font-weight: 600; } .wide { overflow-x: auto; font-size: 13px; }
"""
SLIDE = "this.previousElementSibling.style.clipPath = 'inset(0 ' + (100 - this.value) + '% 0 0)'"


def page(title: str, parts: Iterable[str]) -> str:
    """The whole page under its title; `parts` are HTML."""
    body = "\n".join(parts)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}</style>\n<h1>{html.escape(title)}</h1>\n{body}</html>\n"
    )


def heading(text: str) -> str:
    """A heading of the page."""
    return f"<h2>{html.escape(text)}</h2>"


def note(text: str) -> str:
    """A line the reader should not miss."""
    return f'<p class="note">{html.escape(text)}</p>'


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{html.escape(text)}</p>"


def figure(image: bytes, caption: str) -> str:
    """A PNG with its caption."""
    return f"<figure>{_image(image, caption)}<figcaption>{html.escape(caption)}</figcaption></figure>"


def side_by_side(figures: Sequence[str]) -> str:
    """Two figures in a row, or three."""
    return f'<div class="{"three" if len(figures) == 3 else "two"}">{"".join(figures)}</div>'


def slide(first: bytes, second: bytes, caption: str) -> str:
    """Two PNGs of one size over each other with a handle: the first to its left, the second to its right."""
    return (
        f'<figure class="slide">{_image(second, "right of the handle")}{_image(first, "left of the handle")}'
        f'<input type="range" value="50" aria-label="before and after" oninput="{html.escape(SLIDE)}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def table(rows: Iterable[Sequence[str]], *, head: Sequence[str] = ()) -> str:
    """Rows of words."""
    top = "<tr>" + "".join(f"<th>{html.escape(word)}</th>" for word in head) + "</tr>" if head else ""
    body = "".join("<tr>" + "".join(f"<td>{html.escape(word)}</td>" for word in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table>{top}{body}</table></div>' if head else f"<table>{body}</table>"


def triple(values: object) -> str:
    """Numbers in brackets, four figures each."""
    return "(" + ", ".join(f"{v:.4g}" for v in np.asarray(values, np.float64)) + ")"


def _image(image: bytes, text: str) -> str:
    data = base64.b64encode(image).decode("ascii")
    return f'<img alt="{html.escape(text)}" src="data:image/png;base64,{data}">'
