"""What is said of the package in several files is the same in all: version, authors, Python versions, extras."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.version import Version

import bha

ROOT = Path(__file__).resolve().parents[2]


def toml(name: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


PYPROJECT, CARGO = toml("pyproject.toml"), toml("Cargo.toml")
PROJECT, GROUPS = PYPROJECT["project"], PYPROJECT["dependency-groups"]
EXTRAS = PROJECT["optional-dependencies"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def python_versions() -> list[str]:
    """``3.X`` of the classifiers, in their order."""
    found = (re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", line) for line in PROJECT["classifiers"])
    return [match[1] for match in found if match]


def test_the_version_stands_in_one_place() -> None:
    """``Cargo.toml``; the citation, which no tool fills, says the same."""
    version = CARGO["package"]["version"]
    assert bha.__version__ == version
    assert CITATION["version"] == version
    assert PROJECT["dynamic"] == ["version"]
    assert "version" not in PROJECT
    assert not re.findall(r"__version__\s*=", "".join(path.read_text() for path in ROOT.glob("python/bha/*.py")))


def test_the_version_has_its_changes() -> None:
    """A version that is no longer in the making stands in the changelog; ``Unreleased`` stands above all of them."""
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert headings[0] == "Unreleased"
    released = [Version(heading) for heading in headings[1:]]
    assert released == sorted(released, reverse=True)
    assert not released or released[0] <= Version(CARGO["package"]["version"])


def test_authors_and_licence() -> None:
    assert [author["name"] for author in PROJECT["authors"]] == [author["name"] for author in CITATION["authors"]]
    assert PROJECT["license"] == CARGO["package"]["license"] == CITATION["license"] == "MIT"
    assert (ROOT / PROJECT["license-files"][0]).read_text(encoding="utf-8").startswith("MIT License")


def test_addresses_are_the_same_everywhere() -> None:
    """Where they are known; the release procedure in CONTRIBUTING.md says which lines they are."""
    repository = PROJECT.get("urls", {}).get("Repository")
    assert CARGO["package"].get("repository") == repository
    assert CITATION.get("repository-code") == repository
    assert all(re.match(r"https://\w", url) for url in PROJECT.get("urls", {}).values())


def test_python_versions() -> None:
    """From the oldest that the wheel is for: the wheel's, the classifiers', the linters'."""
    versions = python_versions()
    minors = [int(version.partition(".")[2]) for version in versions]
    assert minors == list(range(minors[0], minors[0] + len(minors)))
    oldest, tag = versions[0], f"py3{minors[0]}"
    required = SpecifierSet(PROJECT["requires-python"])
    assert f"{oldest}.0" in required
    assert f"3.{minors[0] - 1}.99" not in required
    assert f"abi3-{tag}" in CARGO["dependencies"]["pyo3"]["features"]
    assert PYPROJECT["tool"]["ruff"]["target-version"] == tag
    assert PYPROJECT["tool"]["mypy"]["python_version"] == oldest


def test_all_has_every_extra() -> None:
    (everything,) = (Requirement(line) for line in EXTRAS["all"])
    assert everything.name == "bha"
    assert everything.extras == set(EXTRAS) - {"all"}


def test_extras_that_errors_name_are_there() -> None:
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "python/bha").rglob("*.py")]
    named = {name for text in sources for name in re.findall(r"import_extra\([^)]*?extra=\"(\w+)\"", text)}
    assert len(named) > 5
    assert named <= set(EXTRAS)


def requirements(group: str, above: tuple[str, ...] = ()) -> list[Requirement]:
    """Of a dependency group with those it includes (PEP 735)."""
    assert group not in above, f"the group {group} includes itself"
    found = []
    for entry in GROUPS[group]:
        if isinstance(entry, dict):
            assert list(entry) == ["include-group"]
            found += requirements(entry["include-group"], (*above, group))
        else:
            found.append(Requirement(entry))
    return found


def test_dependency_groups_resolve_and_are_those_that_make_installs() -> None:
    """What maintainers need is no part of what users install: nobody's extras are named like a group."""
    for group in GROUPS:
        names = [requirement.name for requirement in requirements(group)]
        assert names
        assert len(names) == len(set(names)), group
    installed = set(re.findall(r"\.ready-(\w+)", (ROOT / "Makefile").read_text(encoding="utf-8")))
    assert installed - {"all"} <= set(GROUPS)
    assert not set(GROUPS) & set(EXTRAS)


def test_the_source_distribution_has_what_builds_and_no_more() -> None:
    """``make wheel`` builds and lists it; this is what both builders are told."""
    assert CARGO["package"]["include"] == ["/rust/src", "/LICENSE"]
    assert CARGO["lib"]["path"].startswith("rust/src/")
    assert set(PYPROJECT["tool"]["maturin"]) == {"manifest-path", "python-source", "module-name", "features"}
