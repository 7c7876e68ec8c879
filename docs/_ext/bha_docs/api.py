"""The reference of the Python interface: what each package exports, each name on one page.

``bha`` exports names of its packages. They stand on the page of ``bha``; pages of packages show the rest.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

import bha


def _skip(app: Sphinx, what: str, name: str, _member: Any, skip: bool, _options: Any) -> bool | None:
    """Leave names that ``bha`` exports to its page, and what pydantic adds to a table out."""
    if what == "module" and app.env.current_document.autodoc_module != "bha" and name in bha.__all__:
        return True
    return True if name in vars(BaseModel) else None


def _signature(
    _app: Sphinx, _what: str, _name: str, value: Any, _options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Leave out how a table of a file is made: its keys are listed with the file."""
    is_table = isinstance(value, type) and issubclass(value, BaseModel)
    return ("", None) if is_table else (signature, returns)


def _undivided(_app: Sphinx, what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Keep napoleon from reading the words before a colon as the type of a property."""
    if what in ("property", "attribute", "data") and lines:
        lines[0] = lines[0].replace(": ", " – ")


def setup(app: Sphinx) -> dict[str, bool]:
    """Add to Sphinx."""
    app.connect("autodoc-skip-member", _skip)
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-process-docstring", _undivided, priority=400)  # before napoleon, at 500
    # Blocks of documents that no highlighter knows: plain text.
    app.add_lexer("csv", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
