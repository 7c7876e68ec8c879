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


def setup(app: Sphinx) -> dict[str, bool]:
    """Add to Sphinx."""
    app.connect("autodoc-skip-member", _skip)
    # Blocks of documents that no highlighter knows: plain text.
    app.add_lexer("csv", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
