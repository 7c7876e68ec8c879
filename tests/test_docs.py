"""Every snippet of README and docs runs, each document in a folder of its own and from top to bottom.

- ``python``: runs; what earlier snippets of the document defined is known.
- ``console``: what follows ``$`` runs in a shell and must succeed; lines of output, where there are any, must appear
  (``...`` stands for anything).
- ``toml NAME`` and ``csv NAME``: written to a file of that name, for the snippets after it.
- ``rust``: compiled and run by ``cargo test --doc``, which ``rust/src/lib.rs`` tells of the document.
- ``text``: a line to be put into a file, not run.
- ``sh``: instructions for a checkout (make, pip), which continuous integration runs; nothing else may stand there.
"""

from __future__ import annotations

import doctest
import os
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
RUN_BY_CONTINUOUS_INTEGRATION = ("make", "pip")


def snippets(document: Path) -> list[Token]:
    return [token for token in MarkdownIt().parse(document.read_text(encoding="utf-8")) if token.type == "fence"]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
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
            included = f'include_str!("../../docs/{document.name}")'
            assert included in (ROOT / "rust/src/lib.rs").read_text(), f"{place}: cargo test does not compile it"
        elif token.info == "text":
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
        assert done.returncode == 0, f"{place}: {command}\n{done.stdout}{done.stderr}"
        flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        if expected.strip() and not doctest.OutputChecker().check_output(expected, done.stdout, flags):
            pytest.fail(f"{place}: {command}\nexpected:\n{expected}\nfound:\n{done.stdout}")


def test_links_lead_somewhere() -> None:
    for document in [*DOCUMENTS, ROOT / "CONTRIBUTING.md"]:
        for token in MarkdownIt().parse(document.read_text(encoding="utf-8")):
            for child in token.children or []:
                target = str(child.attrs.get("href", "")).partition("#")[0]
                if child.type == "link_open" and target and "://" not in target:
                    assert (document.parent / target).exists(), f"{document.name}: {target} is not there"
