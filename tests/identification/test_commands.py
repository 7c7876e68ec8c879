"""``bha identify`` and ``bha excite`` in a stranger's hands: wrong files, what is written and what is not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.parameters import ArmParameters

from .identify_logs import measured, multisine, off, one_section

FREE = ["--free", "section.1.mass", "--free", "section.1.stiffness.1"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("commands")
    arm = one_section()
    off(arm, {"section.1.mass": 1.1}).save(folder / "arm.toml")
    measured(arm, multisine(arm, 3.0, 50.0, 1)).write(folder / "log.csv")
    return folder


def run(*arguments: str | Path) -> tuple[int, str, str]:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    return done.exit_code, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the file is empty"),
        ("t,p11\n0,1\n", "has no unit"),
        ("t [s],p11 [Pa],p12 [Pa],p13 [Pa]\n0,1e5,1e5,1e5\n1,1e5,1e5,1e5\n", "nothing to compare"),
        ("t [s],p11 [Pa],p12 [Pa],q11 [m]\n0,1e5,1e5,0.2\n1,1e5,1e5,0.2\n", "p13"),
        ("t [s],p11 [Pa],p12 [Pa],p13 [Pa],q11 [m]\n0,1e5,1e5,1e5,0.2\n20,1e5,1e5,1e5,0.2\n", "'t [ms]'"),
        ("t [s],p11 [Pa],p12 [Pa],p13 [Pa],q11 [m]\n0,1e5,1e5,1e5,0.2\n", "one row alone"),
        ("t [s],p11 [Pa],p12 [Pa],p13 [Pa],q11 [m]\n0,1e5,1e5,x,0.2\n1,1e5,1e5,1e5,0.2\n", 'found "x"'),
    ],
)
def test_logs_that_cannot_be_used(folder: Path, tmp_path: Path, text: str, said: str) -> None:
    wrong = tmp_path / "wrong.csv"
    wrong.write_text(text)
    out = tmp_path / "out.toml"
    code, _, error = run("identify", folder / "arm.toml", folder / "log.csv", wrong, "--out", out)
    assert code == 1
    assert "wrong.csv" in error
    assert said in error
    assert not out.exists()


def test_what_is_said_and_written(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.toml"
    code, said, error = run("identify", folder / "arm.toml", folder / "log.csv", *FREE, "--out", out)
    assert code == 0, error
    assert "converged after" in said
    assert f"written: {out}" in said.replace("\n", "")
    section = ArmParameters.read(out).sections[0]
    low, high = section.provenance["mass"].ci95  # type: ignore[misc]
    assert low < section.mass < high
    assert abs(section.mass - 0.75) < 2.0 * (high - low) / 2.0
    assert section.provenance["mass"].logs[0].sha256 == bha.Log.read(folder / "log.csv").sha256


def test_a_log_twice_counts_once(folder: Path) -> None:
    code, _, error = run("identify", folder / "arm.toml", folder / "log.csv", folder / "log.csv", *FREE)
    assert code == 1
    assert "the same log" in error
    code, _, error = run("identify", folder / "arm.toml", folder / "log.csv", "--holdout", folder / "log.csv", *FREE)
    assert code == 1
    assert "held out" in error


def test_a_value_outside_of_its_prior_is_a_warning(folder: Path) -> None:
    arguments = ["--free", "section.1.mass=0.75:0.7:0.76", "--free", "section.1.damping", "--json"]
    heavy = folder / "heavy.csv"
    arm = off(one_section(), {"section.1.mass": 1.3})
    measured(arm, multisine(arm, 3.0, 50.0, 2)).write(heavy)
    code, said, _ = run("identify", folder / "arm.toml", heavy, *arguments)
    assert code in (0, 3)
    warnings = json.loads(said)["warnings"]
    assert any(w.startswith("section.1.mass = 0.76 kg is at the edge") for w in warnings)


def test_excite_writes_what_identify_asks_for(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "excitation.csv"
    arguments = ["--duration", "5", "--rate", "50", "--kind", "multisine", "--free", "section.1.mass"]
    code, said, error = run("excite", folder / "arm.toml", "--out", out, *arguments)
    assert code == 0, error
    assert "section.1.mass" in said
    commanded = bha.Log.read(out)
    low, high = one_section().parameters.sections[0].pressure_range
    for name in ("pc11", "pc12", "pc13"):
        assert low <= np.min(commanded[name]) < np.max(commanded[name]) <= high


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (["--duration", "-1"], "duration: -1.0; allowed: at least 1 s"),
        (["--free", "section.9.mass"], "no parameter 'section.9.mass'"),
        (["--duration", "5", "--rate", "50", "--out", "x.txt"], "unknown extension .txt"),
        (["--amplitude", "nan"], "amplitude"),
        (["--seed", "-1"], "seed: -1; allowed: 0 and any greater whole number"),
        (["--duration", "1e300"], "duration: 1e+300 s at 200 samples a second; allowed: 1 to 25000 s"),
    ],
)
def test_excitations_that_are_not_possible(folder: Path, extra: list[str], said: str) -> None:
    code, _, error = run("excite", folder / "arm.toml", *extra)
    assert code == 1
    assert said in error
