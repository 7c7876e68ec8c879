from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.cli.identified import show
from bha.identification import FreeParameter, Identification, Settings, excite, identify
from bha.identification.identifiability import Combination
from bha.parameters import ArmParameters, paths

from .identify_logs import measured, multisine, off, one_section

FREE = ("section.1.mass", "section.1.stiffness.1", "section.1.bending_stiffness.1", "section.1.damping")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a start, a log to fit and one to hold out."""
    folder = tmp_path_factory.mktemp("identify")
    arm = one_section()
    off(arm, dict.fromkeys(FREE, 1.25)).save(folder / "start.toml")
    measured(arm, multisine(arm, 4.0, 100.0, 1), seed=1).write(folder / "fit.csv")
    measured(arm, multisine(arm, 3.0, 100.0, 2), seed=2).write(folder / "held.csv")
    return folder


@pytest.fixture(scope="module")
def result(files: Path) -> Identification:
    arm = bha.Arm.load(files / "start.toml")
    logs = [bha.Log.read(files / name) for name in ("fit.csv", "held.csv")]
    return identify(arm, logs[:1], FREE, holdout=logs[1:], settings=Settings(windows=(0.75, 2.0), draws=4))


def test_parameter_file_says_what_was_identified(result: Identification, files: Path) -> None:
    result.parameters().write(files / "identified.toml")
    read = ArmParameters.read(files / "identified.toml")
    section = read.sections[0]
    assert section.provenance["mass"].status == "identified"
    low, high = section.provenance["mass"].ci95  # type: ignore[misc]
    assert low < section.mass < high
    assert section.provenance["mass"].logs[0].name == "fit.csv"
    assert section.provenance["mass"].logs[0].sha256 == bha.Log.read(files / "fit.csv").sha256
    stiffness = section.provenance["stiffness"]
    assert stiffness.ci95 is not None
    assert stiffness.ci95[0][0] < section.stiffness[0] < stiffness.ci95[0][1]  # type: ignore[index]
    assert stiffness.ci95[1] == (1500.0, 1500.0)
    assert section.provenance.get("rest_length") is None


def test_estimates_in_a_notebook_and_as_a_table(result: Identification) -> None:
    shown = result._repr_html_()
    assert shown.count("<tr>") == len(FREE) + 1
    assert all(f">{name}</td>" in shown for name in FREE)
    pytest.importorskip("pandas")
    table = result.to_pandas()
    assert list(table.index) == [estimate.name for estimate in result.estimates]
    mass = next(estimate for estimate in result.estimates if estimate.name == "section.1.mass")
    assert (table.loc["section.1.mass", "value"], table.loc["section.1.mass", "unit"]) == (mass.value, "kg")
    assert tuple(table.loc["section.1.mass", ["low", "high"]]) == mass.interval
    assert table.loc["section.1.mass", "identified"]


def test_held_out_error_is_the_noise(result: Identification) -> None:
    (held,) = result.held_out
    assert held.after.rms == pytest.approx(held.after.record.noise, rel=0.15)
    assert np.all(held.before.rms > 3 * held.after.rms)


def test_a_result_is_a_line(result: Identification) -> None:
    text = repr(result)
    assert text.startswith(f"Identification({result.start.name!r}: ")
    assert f"{len(FREE)} of {len(FREE)} parameters told by 1 log, converged" in text
    assert "\n" not in text


def test_residuals_are_judged(result: Identification) -> None:
    assert len(result.residuals) == 3
    for r in result.residuals:
        assert r.rms == pytest.approx(r.noise, rel=0.15)
        assert r.follows_by < 0.3
    assert not any("lacks physics" in w for w in result.warnings)


def test_a_gap_is_not_swallowed(files: Path) -> None:
    """Springs far from what the arm says, with only the mass free: the mass ends at its bound, and it is said."""
    arm = one_section()
    log = measured(off(arm, {"section.1.stiffness.1": 1.6}), multisine(arm, 3.0, 100.0, 3))
    free = [FreeParameter("section.1.mass", lower=0.6, upper=0.9)]
    found = identify(arm, [log], free, settings=Settings(windows=(1.0,), draws=0))
    assert any("stands in for something the model lacks" in w or "lacks physics" in w for w in found.warnings)
    assert any("more than the sensors' noise" in w and "`bha diagnose` names" in w for w in found.warnings)


def test_command(files: Path) -> None:
    arguments = ["identify", str(files / "start.toml"), str(files / "fit.csv"), "--holdout", str(files / "held.csv")]
    arguments += ["--out", str(files / "out.toml"), "--windows", "0.75,2", "--json"]
    for path in FREE:
        arguments += ["--free", path]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert summary["converged"]
    assert {p["path"] for p in summary["parameters"]} == set(FREE)
    assert summary["held_out"][0]["log"] == "held.csv"
    assert paths.get_value(ArmParameters.read(files / "out.toml"), FREE[0]) == pytest.approx(0.75, rel=0.05)


def test_command_that_does_not_converge(files: Path) -> None:
    arguments = [
        "identify",
        str(files / "start.toml"),
        str(files / "fit.csv"),
        "--windows",
        "all",
        "--max-iterations",
        "1",
    ]
    arguments += ["--free", FREE[0], "--free", FREE[1], "--out", str(files / "best.toml")]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 3, done.output
    assert "NOT CONVERGED" in done.output
    assert (files / "best.toml").exists()


@pytest.mark.parametrize(
    ("extra", "text"),
    [
        (["--free", "section.1.mas"], "nearest allowed: 'section.1.mass'"),
        (["--free", "section.1.mass=a"], "numbers are needed"),
        (["--windows", "0"], "positive numbers of seconds"),
        (["--out", "/nowhere/x.toml"], "does not exist"),
        (["--holdout", "nowhere.csv"], "nowhere.csv"),
    ],
)
def test_command_with_wrong_arguments(files: Path, extra: list[str], text: str) -> None:
    done = CliRunner().invoke(main, ["identify", str(files / "start.toml"), str(files / "fit.csv"), *extra])
    assert done.exit_code == 1
    assert text in done.stderr


def test_excitation_stays_within_limits_and_tells_everything() -> None:
    arm = one_section()
    proposal = excite(arm, duration=12.0, rate=100.0, amplitude=0.9)
    low, high = arm.parameters.sections[0].pressure_range
    assert proposal.pressures.min() >= low
    assert proposal.pressures.max() <= high
    assert proposal.unknown == ()
    assert all(p.told for p in proposal.prospects)
    again = excite(arm, duration=12.0, rate=100.0, amplitude=0.9)
    assert np.array_equal(proposal.pressures, again.pressures)


def test_excitation_predicts_the_standard_errors_of_a_fit() -> None:
    arm = one_section()
    proposal = excite(arm, duration=8.0, rate=100.0, free=FREE)
    log = measured(arm, bha.Input(proposal.time, proposal.pressures), pressure_noise=1e-3)
    found = identify(arm, [log], FREE, settings=Settings(windows=(None,), draws=0))
    for prospect, estimate in zip(proposal.prospects, found.estimates, strict=True):
        assert estimate.standard_error == pytest.approx(prospect.standard_error, rel=0.4)


def test_excitation_command(tmp_path: Path) -> None:
    one_section().save(tmp_path / "arm.toml")
    out = tmp_path / "excitation.csv"
    arguments = ["excite", str(tmp_path / "arm.toml"), "--out", str(out), "--duration", "6", "--rate", "50", "--json"]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 0, done.output
    # Mass, three powers of the spring, bending, damping; area and rest length, which a file has to some per cent only.
    assert len(json.loads(done.stdout)["parameters"]) == 8
    log = bha.Log.read(out)
    assert log.columns == ("t", "pc11", "pc12", "pc13")


@pytest.mark.parametrize("wrong", [{"duration": 0.0}, {"amplitude": 1.5}, {"kinds": ("dance",)}, {"noise": -1.0}])
def test_wrong_excitations(wrong: dict[str, object]) -> None:
    with pytest.raises(bha.InputError, match=next(iter(wrong))):
        excite(one_section(), **wrong)  # type: ignore[arg-type]


def test_of_many_combinations_that_are_not_told_the_worst_are_shown(
    result: Identification, capsys: pytest.CaptureFixture[str]
) -> None:
    direction = np.array([1.0, 0.0, 0.0, 0.0])
    unknown = tuple(Combination(f"number {k}", ("section.1.mass",), direction, 10.0 - k) for k in range(6))
    said = tuple(f"not identified: {combination.text}" for combination in unknown)
    show(replace(result, unknown=unknown, warnings=(*said, "the last one")))
    printed = "".join(capsys.readouterr())
    assert "number 3" in printed
    assert "number 4" not in printed
    assert "not identified: 2 more" in printed
    assert "the last one" in printed
