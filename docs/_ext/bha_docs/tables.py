"""Tables that a phone can show: every cell knows the heading of its column.

Where a screen is narrow, ``site.css`` shows each row as a card of its cells, and the heading stands before each of
them. Which heading that is, is written into the HTML here, as ``data-heading``.
"""

from __future__ import annotations

from typing import Any

from bs4 import BeautifulSoup
from docutils import nodes
from sphinx.application import Sphinx


def name_columns(body: str) -> str:
    """HTML whose table cells have the text of their column's heading as ``data-heading``."""
    soup = BeautifulSoup(body, "html.parser")
    for table in soup.find_all("table"):
        headings = [cell.get_text(" ", strip=True) for cell in table.select("thead tr:last-child > th")]
        for row in table.select("tbody > tr"):
            for cell, heading in zip(row.find_all(["td", "th"], recursive=False), headings, strict=False):
                if cell.get_text(strip=True) or cell.img:  # an empty cell has nothing to be headed
                    cell["data-heading"] = heading
    return str(soup)


def _page(_app: Sphinx, _page: str, _template: str, context: dict[str, Any], doctree: nodes.document | None) -> None:
    if doctree is not None and "<table" in context["body"]:
        context["body"] = name_columns(context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Add to Sphinx."""
    app.connect("html-page-context", _page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
