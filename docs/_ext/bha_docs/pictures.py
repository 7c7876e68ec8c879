"""Pictures that scripts of the repository draw while the site is built.

````
```{picture} examples/gallery/tilt.py
:alt: what is seen, for those who cannot see it
:code:

A caption.
```
````

The script, a path from the top of the repository, writes ``tilt.svg`` into the folder it runs in, which has
``examples`` as the top of the repository has. With ``:code:`` the script without its docstring stands below its
picture. A script runs again when it, its neighbours or the package have changed.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

import bha

ROOT = Path(__file__).resolve().parents[3]
#: Where pictures are kept, in the folder of the pages: Sphinx takes them from there.
GENERATED = "_generated"
#: A picture that takes longer, s, belongs into ``docs/figures``.
LONGEST = 120

logger = logging.getLogger(__name__)


def drawn(script: Path, folder: Path) -> Path:
    """The picture of a script in ``folder``; drawn if it is not there or older than what it follows from.

    Raises:
        RuntimeError: the script failed, or wrote no picture of its name.
    """
    picture = folder / f"{script.stem}.svg"
    package = Path(bha.__file__).parent
    sources = [*script.parent.glob("*.py"), *package.rglob("*.py"), *package.glob("_core*.so")]
    if picture.exists() and picture.stat().st_mtime > max(source.stat().st_mtime for source in sources):
        return picture
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        Path(place, "examples").symlink_to(ROOT / "examples")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(package.parent), str(script.parent)])}
        run = subprocess.run(
            [sys.executable, "-W", "error", script],
            cwd=place,
            env=environment,
            capture_output=True,
            text=True,
            timeout=LONGEST,
            check=False,
        )
        written = Path(place, picture.name)
        if run.returncode or not written.exists():
            raise RuntimeError(f"{script}: no {picture.name} was drawn\n{run.stdout}{run.stderr}")
        picture.write_bytes(written.read_bytes())
    return picture


def without_docstring(source: str) -> str:
    """The code of a script from behind its docstring on."""
    first = ast.parse(source).body[0]
    is_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    lines = source.splitlines()[first.end_lineno if is_docstring else 0 :]
    return "\n".join(lines).strip() + "\n"


class Picture(SphinxDirective):
    """The directive ``picture``."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar = {"alt": directives.unchanged_required, "code": directives.flag}

    def run(self) -> list[nodes.Node]:
        """A figure, and the script below it where that is asked for."""
        script = ROOT / self.arguments[0]
        self.env.note_dependency(str(script))
        if "alt" not in self.options:
            raise self.error(f"picture {self.arguments[0]}: say in :alt: what is seen")
        try:
            picture = drawn(script, Path(self.env.srcdir, GENERATED))
        except (OSError, RuntimeError, subprocess.TimeoutExpired) as error:
            raise self.error(str(error)) from error
        image = nodes.image(uri=f"/{GENERATED}/{picture.name}", alt=self.options["alt"])
        figure = nodes.figure("", image, classes=["picture"])
        if self.content:
            caption = nodes.caption()
            caption += self.parse_inline(" ".join(self.content))[0]
            figure += caption
        shown: list[nodes.Node] = [figure]
        if "code" in self.options:
            code = without_docstring(script.read_text(encoding="utf-8"))
            shown.append(nodes.literal_block(code, code, language="python"))
        return shown


def setup(app: Sphinx) -> dict[str, bool]:
    """Add to Sphinx."""
    app.add_directive("picture", Picture)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
