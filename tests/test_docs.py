"""Every snippet of README and docs runs, each document in a folder of its own and from top to bottom; links and the
navigation of the site lead somewhere.

- ``python``: runs; what earlier snippets of the document defined is known.
- ``console``: what follows ``$`` runs in a shell and must succeed, or fail where ``error: `` is shown; lines of output,
  where there are any, must appear (``...`` stands for anything).
- ``toml NAME`` and ``csv NAME``: written to a file of that name, for the snippets after it.
- ``rust``: compiled and run by ``cargo test --doc``, which ``rust/src/lib.rs`` tells of the document.
- ``text``: a line to be put into a file, not run.
- ``{directive}``: for the site, which `make docs` builds; code cells of notebooks, too, run there.
- ``sh``: instructions for a checkout (make, pip), which continuous integration runs; nothing else may stand there.
"""

from __future__ import annotations

import doctest
import os
import re
import runpy
import subprocess
import sysconfig
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
DOCUMENTS = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
DIRECTIVE = re.compile(r"\{[\w-]+\}")
RUN_BY_CONTINUOUS_INTEGRATION = ("make", "pip")


@cache
def parsed(document: Path) -> list[Token]:
    return MarkdownIt().enable("table").parse(document.read_text(encoding="utf-8"))


def snippets(document: Path) -> list[Token]:
    return [token for token in parsed(document) if token.type == "fence"]


#: Decisions keep the commands of their day.
RUN = [document for document in DOCUMENTS if document.parent.name != "decisions"]


@pytest.mark.skipif(os.name == "nt", reason="console blocks are for a shell of POSIX")
@pytest.mark.parametrize("document", RUN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_snippets(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("examples", "python"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", sysconfig.get_path("scripts") + os.pathsep + os.environ["PATH"])
    known: dict[str, Any] = {"__name__": "__main__"}
    for token in snippets(document):
        assert token.map is not None
        language, *names = token.info.split() or [""]
        place = f"{document.relative_to(ROOT)}, line {token.map[0] + 1}"
        if language == "python":
            # Empty lines before it, so that a traceback gives the line of the document.
            exec(compile("\n" * (token.map[0] + 1) + token.content, document, "exec"), known)
        elif language == "console":
            run_console(token.content, place)
        elif language in ("toml", "csv") and names:
            Path(names[0]).write_text(token.content, encoding="utf-8")
        elif language == "rust":
            included = f'include_str!("../../{document.relative_to(ROOT).as_posix()}")'
            assert included in (ROOT / "rust/src/lib.rs").read_text(), f"{place}: cargo test does not compile it"
        elif token.info == "text" or DIRECTIVE.fullmatch(language):
            pass
        elif language == "sh":
            commands = [line.split()[0] for line in token.content.splitlines() if line.strip()]
            assert set(commands) <= set(RUN_BY_CONTINUOUS_INTEGRATION), f"{place}: use a console block"
        else:
            pytest.fail(f"{place}: a block of {token.info or 'no language'!r} is not tested; see {Path(__file__).name}")


def run_console(text: str, place: str) -> None:
    assert text.startswith("$ "), f"{place}: a console block starts with a command, '$ ...'"
    for part in text.removeprefix("$ ").split("\n$ "):
        command, _, expected = part.partition("\n")
        done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=120, check=False)
        # An error that is shown has to come, with its words.
        fails = expected.startswith("error: ")
        assert (done.returncode == 1) == fails, f"{place}: {command}\n{done.stdout}{done.stderr}"
        found = done.stderr if fails else done.stdout
        flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        if expected.strip() and not doctest.OutputChecker().check_output(expected, found, flags):
            pytest.fail(f"{place}: {command}\nexpected:\n{expected}\nfound:\n{found}")


def anchors(document: Path) -> set[str]:
    """The anchors of a document's headings, as code hosts and MyST make them."""
    tokens = parsed(document)
    headings = [inline.content for before, inline in pairwise(tokens) if before.type == "heading_open"]
    return {re.sub(r"[^\w\- ]", "", heading.lower().strip()).replace(" ", "-") for heading in headings}


def test_links_lead_somewhere() -> None:
    for document in [*DOCUMENTS, ROOT / "CONTRIBUTING.md"]:
        for child in (child for token in parsed(document) for child in token.children or []):
            link = str(child.attrs.get("href" if child.type == "link_open" else "src", ""))
            target, _, anchor = link.partition("#")
            if not link or "://" in link:
                continue
            place = document.parent / target if target else document
            assert place.exists(), f"{document.relative_to(ROOT)}: {link} is not there"
            if anchor and place.suffix == ".md":
                assert anchor in anchors(place), f"{document.relative_to(ROOT)}: {target} has no heading {anchor!r}"


def test_the_site_leads_to_every_page_once() -> None:
    pages = {page for kind in ("*.md", "*.ipynb") for page in DOCS.rglob(kind) if "_generated" not in page.parts}
    reached = [DOCS / "index.md"]
    for page in reached:
        for token in snippets(page) if page.suffix == ".md" else ():
            if token.info.strip() == "{toctree}":
                lines = [line for line in token.content.splitlines() if line and not line.startswith(":")]
                for line in lines:
                    found = sorted(entry for kind in (".md", ".ipynb") for entry in page.parent.glob(line + kind))
                    assert found, f"{page.relative_to(ROOT)}: {line} in its toctree is not there"
                    # Resolved: a page may stand in another folder than the one that lists it.
                    reached += [entry.resolve() for entry in found]
    assert len(reached) == len(set(reached)), "a page stands in two toctrees"
    assert set(reached) == pages, f"in no toctree: {sorted(page.name for page in pages - set(reached))}"


SCRIPTS = sorted([*(ROOT / "examples/gallery").glob("*.py"), *(DOCS / "sketches").glob("[!_]*.py")])


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_scripts_draw_the_pictures_of_the_site(script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(script.parent)
    runpy.run_path(str(script), run_name="__main__")
    assert (tmp_path / f"{script.stem}.svg").stat().st_size > 5_000


def test_every_script_stands_on_a_page() -> None:
    shown = {
        token.info.split(maxsplit=1)[1]
        for document in DOCUMENTS
        for token in snippets(document)
        if token.info.startswith("{picture}")
    }
    assert shown == {script.relative_to(ROOT).as_posix() for script in SCRIPTS}
