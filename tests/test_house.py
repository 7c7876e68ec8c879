"""The house of python/bha: imports go along the map in CONTRIBUTING.md, and no files import each other in a circle.

Imports in functions and for types count like all others.
"""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Set
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import bha
from bha.sweeps.partitions import CHECKSUM, FINGERPRINT, PARTITION

PACKAGE = Path(bha.__file__).parent
MAP = PACKAGE.parents[1] / "CONTRIBUTING.md"
#: What is seen from outside, and ``python -m bha``: they stand above all rooms.
DOORS = {"bha", "bha.__main__"}


def rooms() -> dict[str, set[str] | None]:
    """The map, from the top down: what each room may import; None: every room."""
    table = MAP.read_text(encoding="utf-8").partition("| room | what | may import |\n")[2].partition("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[1:]]
    return {
        room.strip("`"): None if allowed == "every room" else set(filter(None, allowed.split(", ")))
        for room, _, allowed in rows
    }


@cache
def modules() -> dict[str, Path]:
    """Every module of the package by name; a package is its ``__init__``, the core its stub."""
    found = {}
    for path in (*PACKAGE.rglob("*.py"), PACKAGE / "_core.pyi"):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(path: Path, known: Set[str]) -> Iterator[str]:
    """Modules of the package that a file imports, wherever in it."""
    for node in ast.walk(tree(path)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}, line {node.lineno}: imports are written from bha on"
            inside = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in known else str(node.module) for name in inside]
        yield from (name for name in names if name.partition(".")[0] == "bha")


def imports_of_the_core() -> set[str]:
    """Modules whose objects the core takes by name."""
    sources = (PACKAGE.parents[1] / "rust" / "src").rglob("*.rs")
    return {name for path in sources for name in re.findall(r'import\(py, "(bha\.[\w.]+)"', path.read_text("utf-8"))}


@cache
def arrows() -> dict[str, set[str]]:
    """Module -> those it imports."""
    found = modules()
    graph = {name: set(imports(path, found.keys())) for name, path in found.items()}
    graph["bha._core"] |= imports_of_the_core()
    return graph


def room_of(module: str) -> str:
    return module.split(".")[1]


def circle(graph: Mapping[str, Set[str]]) -> str | None:
    """A circle in words, or None."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " is imported by ".join(error.args[1])
    return None


def test_the_map_names_every_room_and_runs_downwards() -> None:
    found = rooms()
    assert set(found) == {room_of(name) for name in modules() if name not in DOORS}
    order = list(found)
    for room, allowed in found.items():
        upwards = (allowed or set()) - set(order[order.index(room) + 1 :])
        assert not upwards, f"the map lets {room} import {upwards}, which do not stand below it"


def test_imports_go_along_the_map() -> None:
    found = rooms()
    faults, used = [], set()
    for name, target in ((name, target) for name, targets in arrows().items() for target in targets):
        if name in DOORS:
            continue
        if target in DOORS:
            faults.append(f"{name} imports {target}; import what is behind it")
            continue
        room, other = room_of(name), room_of(target)
        allowed = found[room]
        used.add((room, other))
        if room != other and allowed is not None and other not in allowed:
            faults.append(f"{name} imports {target}; the map lets {room} import {', '.join(sorted(allowed))}")
    assert not faults, "\n".join(faults)
    needless = {(room, other) for room, allowed in found.items() for other in allowed or ()} - used
    assert not needless, f"the map allows what nobody does: {needless}"


def test_one_door_into_the_core() -> None:
    """What the core offers is called in one file, which says to all others what it means; classes are types, too."""
    called: dict[str, set[str]] = {}
    for name, path in modules().items():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                holder = node.func.value
                if isinstance(holder, ast.Name) and holder.id == "_core":
                    called.setdefault(node.func.attr, set()).add(name)
    assert "simulate_batch" in called
    assert not {name: places for name, places in called.items() if len(places) > 1}


def test_no_files_import_each_other_in_a_circle() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}})
    assert circle(arrows()) is None


def test_the_reference_shares_nothing_with_the_core() -> None:
    """At any distance, so that each can check the other."""
    graph, seen = arrows(), set()
    waiting = {name for name in graph if name not in DOORS and room_of(name) == "reference"}
    while waiting:
        seen |= waiting
        waiting = {target for name in waiting for target in graph[name]} - seen
    assert {room_of(name) for name in seen} == {"reference", "errors"}


def test_no_name_hides_a_module() -> None:
    """``import bha.diagnosis.result`` gives the module, whatever its package exports."""
    for name in modules():
        package, _, last = name.rpartition(".")
        if package and last != "__main__":
            importlib.import_module(name)
            assert isinstance(getattr(importlib.import_module(package), last), ModuleType), name


def texts() -> Iterator[tuple[str, str]]:
    """Documents and docstrings, by where they stand."""
    root = PACKAGE.parents[1]
    for document in (root / "README.md", root / "CONTRIBUTING.md", *sorted((root / "docs").rglob("*.md"))):
        yield document.name, document.read_text(encoding="utf-8")
    for name, path in modules().items():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                yield name, ast.get_docstring(node) or ""


def is_there(name: str) -> bool:
    """Whether a dotted name is that of a module, of something in one, or of a file's metadata."""
    if name in (FINGERPRINT, PARTITION, CHECKSUM):
        return True
    found: Any = bha
    path, *rest = name.split(".")
    for step in rest:
        path = f"{path}.{step}"
        if not hasattr(found, step) and path not in modules():
            return False
        found = getattr(found, step) if hasattr(found, step) else importlib.import_module(path)
    return True


def test_what_documents_and_docstrings_name_is_there() -> None:
    found = re.compile(r"\bbha(?:\.[A-Za-z_]\w*)+")
    named = {(name, where) for where, text in texts() for name in found.findall(text) if not name.endswith(".md")}
    assert len(named) > 100
    assert not [f"{where}: {name}" for name, where in sorted(named) if not is_there(name)]


def test_examples_need_public_names_only() -> None:
    """What a package of ``bha`` lists in ``__all__``."""
    examples = sorted((PACKAGE.parents[1] / "examples").rglob("*.py"))
    assert examples
    for path in examples:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and str(node.module).partition(".")[0] == "bha":
                assert str(node.module).count(".") <= 1, f"{path.name} imports {node.module}"
                public = importlib.import_module(str(node.module)).__all__
                assert {alias.name for alias in node.names} <= set(public), f"{path.name}, line {node.lineno}"
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names if alias.name.partition(".")[0] == "bha"]
                assert all(name == "bha" for name in names), f"{path.name} imports {names}"


def test_verbs_are_there_and_imported_when_asked_for() -> None:
    """Type checkers see them where the interpreter imports them later."""
    assert all(hasattr(bha, name) for name in bha.__all__)
    assert set(bha.__all__) <= set(dir(bha))
    block, _ = (node for node in tree(Path(bha.__file__)).body if isinstance(node, ast.If))
    for_types = {
        alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert for_types == bha._LATER
    later = sorted(set(bha._LATER.values()))
    code = f"import sys, bha; print([name for name in {later} if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
    with pytest.raises(AttributeError, match="no_such_name"):
        bha.no_such_name  # noqa: B018
