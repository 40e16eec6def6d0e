"""Links to a heading by its old name: `(old-name)=` above a heading is found as `page.md#old-name`, with no warning."""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx


def _names_of_headings(app: Sphinx, doctree: nodes.document) -> None:
    slugs = app.env.metadata[app.env.docname].setdefault("myst_slugs", {})
    for section in doctree.findall(nodes.section):
        title = section.next_node(nodes.title)
        for name in section["ids"]:
            slugs.setdefault(name, (section.line or 0, section["ids"][0], title.astext() if title else name))


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("doctree-read", _names_of_headings)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
