"""Workflows and forms of the repository: what they call is there, what they may do is little, all is pinned.

`make lint` has their schemas checked and their expressions; here stands what no linter knows of this repository.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from click.testing import CliRunner

from bha.cli import main

from .test_metadata import CARGO, PROJECT, ROOT, python_versions

GITHUB = ROOT / ".github"
WORKFLOWS = {path.name: path.read_text(encoding="utf-8") for path in sorted((GITHUB / "workflows").glob("*.yml"))}
FORMS = {path.name: path.read_text(encoding="utf-8") for path in sorted((GITHUB / "ISSUE_TEMPLATE").glob("*_*.yml"))}
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = set(re.findall(r"^([a-z][a-z-]*):", MAKEFILE, re.MULTILINE))


def parsed(text: str) -> dict[Any, Any]:
    found = yaml.safe_load(text)
    assert isinstance(found, dict)
    return found


def jobs() -> Iterator[tuple[str, str, dict[str, Any]]]:
    for name, text in WORKFLOWS.items():
        for job, content in parsed(text)["jobs"].items():
            yield name, job, content


def commands() -> Iterator[tuple[str, str]]:
    """Lines that the workflows and the hooks run."""
    for name, _, job in jobs():
        for step in job.get("steps", []):
            yield from ((name, line.strip()) for line in step.get("run", "").splitlines())
    (repository,) = parsed((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    yield from ((".pre-commit-config.yaml", hook["entry"]) for hook in repository["hooks"])


def test_workflows_are_there() -> None:
    assert {"audit.yml", "docs.yml", "release.yml", "test.yml", "wheels.yml"} <= set(WORKFLOWS)


def test_what_they_run_is_there() -> None:
    targets, scripts = set(), set()
    for name, line in commands():
        targets |= {(name, target) for target in re.findall(r"\bmake ([a-z][a-z-]*)", line)}
        scripts |= {(name, script) for script in re.findall(r"\bpython (\S+\.py)", line)}
    assert {target for _, target in targets} >= {"test", "lint", "docs", "audit", "lint-rust"}
    assert not [(name, target) for name, target in targets if target not in TARGETS]
    assert not [(name, script) for name, script in scripts if not (ROOT / script).is_file()]


def test_phony_targets_are_declared() -> None:
    """A file of that name would stop make from running them."""
    (declared,) = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)
    assert set(declared.split()) == TARGETS


def test_actions_are_pinned_to_one_commit_each() -> None:
    """By the full hash, with the version beside it; the same in all files."""
    pins: dict[str, set[tuple[str, str]]] = {}
    for name, text in WORKFLOWS.items():
        for used in re.findall(r"uses: (.+)", text):
            if used.startswith("./"):
                assert (ROOT / used.split(" ")[0]).is_file(), f"{name}: {used}"
                continue
            match = re.fullmatch(r"([\w./-]+)@([0-9a-f]{40}) # (v\d+\.\d+\.\d+)", used)
            assert match, f"{name}: {used} is not ACTION@HASH # vX.Y.Z"
            pins.setdefault(match[1], set()).add((match[2], match[3]))
    assert len(pins) > 5
    assert not {action: found for action, found in pins.items() if len(found) > 1}


def test_rights_are_the_least() -> None:
    """Reading, for all; a job that needs more says so itself, and says what for."""
    for name, text in WORKFLOWS.items():
        workflow = parsed(text)
        assert workflow["permissions"] == {"contents": "read"}, name
        assert "group" in workflow["concurrency"], name
    more = {(name, job): content["permissions"] for name, job, content in jobs() if "permissions" in content}
    assert more == {
        ("docs.yml", "publish"): {"pages": "write", "id-token": "write"},
        ("release.yml", "publish"): {"id-token": "write"},
        ("release.yml", "release"): {"contents": "write"},
    }
    for name, job, content in jobs():
        assert "uses" in content or name == "docs.yml" or "timeout-minutes" in content, f"{name}, {job}: no time limit"
        for step in content.get("steps", []):
            if step.get("uses", "").startswith("actions/checkout@"):
                assert step["with"]["persist-credentials"] is False, f"{name}, {job}"


def test_tests_run_on_three_systems_with_the_oldest_and_the_newest_python() -> None:
    steps = parsed(WORKFLOWS["test.yml"])["jobs"]
    matrix = steps["systems"]["strategy"]["matrix"]
    versions = python_versions()
    assert matrix["python"] == [versions[0], versions[-1]]
    assert {system.partition("-")[0] for system in matrix["system"]} == {"ubuntu", "macos", "windows"}
    # What the matrix leaves out runs by make.
    assert matrix["exclude"] == [{"system": matrix["system"][0], "python": versions[0]}]
    (python,) = (s["with"]["python-version"] for s in steps["checkout"]["steps"] if "setup-python" in s.get("uses", ""))
    assert python == versions[0]


def test_wheels_are_built_for_what_the_metadata_names() -> None:
    """And proved on the system that they are for."""
    job = parsed(WORKFLOWS["wheels.yml"])["jobs"]["wheel"]
    targets = {row["target"]: row["runner"].partition("-")[0] for row in job["strategy"]["matrix"]["include"]}
    assert targets == {
        "x86_64-unknown-linux-gnu": "ubuntu",
        "aarch64-unknown-linux-gnu": "ubuntu",
        "x86_64-apple-darwin": "macos",
        "aarch64-apple-darwin": "macos",
        "x86_64-pc-windows-msvc": "windows",
    }
    systems = {line.split(" :: ")[-1] for line in PROJECT["classifiers"] if line.startswith("Operating System")}
    assert systems == {"Linux", "MacOS", "Windows"}
    deny = (ROOT / "deny.toml").read_text(encoding="utf-8")
    assert all(f'"{target}"' in deny for target in targets)


def test_forms_ask_for_what_answers_need() -> None:
    """The version, the arm and what `bha check` says; in the words of commands that are there."""
    assert len(FORMS) == 3
    for name in (name for name in FORMS if "wish" not in name):
        fields = {field["id"]: field for field in parsed(FORMS[name])["body"] if "id" in field}
        assert {"version", "arm", "check"} <= set(fields), name
        assert fields["version"]["validations"]["required"] is True
        assert "bha check ARM.toml LOG... --json" in fields["check"]["attributes"]["description"]
    for command, option in set(re.findall(r"`bha (\w+) [^`]*?(--\w+)", "".join(FORMS.values()))):
        answer = CliRunner().invoke(main, [command, "--help"])
        assert option in answer.output, f"bha {command} has no {option}"
    shown = CliRunner().invoke(main, ["--version"]).output.strip()
    assert shown.rpartition(" ")[0] == "bha, version", "the forms show what bha --version prints"
    assert all("placeholder: bha, version " in text for name, text in FORMS.items() if "wish" not in name)


def release_notes() -> Any:
    spec = importlib.util.spec_from_file_location("release_notes", ROOT / ".ci" / "release_notes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.notes


def test_notes_of_a_release() -> None:
    notes = release_notes()
    top = "# Changes\n\n## [Unreleased]\n"
    version = "## [1.2.0] - 2027-01-31\n\n### Added\n\n- This.\n\n## [1.1.0] - 2026-12-01\n\n- That.\n"
    assert notes("v1.2.0", "1.2.0", f"{top}\n{version}") == "### Added\n\n- This.\n"
    with pytest.raises(ValueError, match=r"the tag is v1.2.1, the version of Cargo.toml 1.2.0"):
        notes("v1.2.1", "1.2.0", f"{top}\n{version}")
    with pytest.raises(ValueError, match="unreleased changes"):
        notes("v1.2.0", "1.2.0", f"{top}\n- Something.\n\n{version}")
    with pytest.raises(ValueError, match=r"'\[1.3.0\] - YYYY-MM-DD' must stand there"):
        notes("v1.3.0", "1.3.0", f"{top}\n{version}")
    with pytest.raises(ValueError, match="'nothing'"):
        notes("v1.2.0", "1.2.0", top)


def test_the_changelog_is_one_that_notes_are_read_from() -> None:
    version = CARGO["package"]["version"]
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    dated = changelog.replace("## [Unreleased]\n", f"## [Unreleased]\n\n## [{version}] - 2026-01-01\n", 1)
    assert release_notes()(f"v{version}", version, dated)
