"""Logs that differ in what is known (payloads, mountings), and in what is estimated session by session."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.estimation.conditions import Condition, changes_of
from bha.identification import FreeParameter, Identification, Settings, identify, predict, record
from bha.parameters import ArmParameters

from .identify_logs import measured, multisine, off, one_section

SCALED = tuple(f"section.1.{key}" for key in ("mass", "stiffness.1", "bending_stiffness.1", "damping", "terminal_area"))


def with_inertia_of_its_mass() -> bha.Arm:
    """One section, linear springs, the inertia following from its mass: a stated one would tell the scale."""
    mapping = one_section().parameters.to_mapping()
    mapping["section"][0].pop("inertia")
    mapping["section"][0]["provenance"].pop("inertia")
    mapping["section"][0]["stiffness"] = [1600.0]
    return bha.Arm(ArmParameters.from_mapping(mapping))


def under(arm: bha.Arm, changes: dict[str, float]) -> bha.Arm:
    return bha.Arm(Condition("", changes_of(changes)).applied(arm.parameters))


def test_a_known_payload_tells_mass_from_stiffness() -> None:
    """All forces times 1.2 is the same motion, until a known mass hangs on the arm in one of two logs."""
    arm = with_inertia_of_its_mass()
    start = off(arm, dict.fromkeys(SCALED, 1.2))
    drives = [multisine(arm, 3.0, 40.0, seed) for seed in (1, 2)]
    light = [record(start, measured(arm, drive, seed=k)) for k, drive in enumerate(drives)]
    payload = {"section.1.payload": 0.4}
    heavy = record(start, measured(under(arm, payload), drives[1], seed=1), changes=payload)
    settings = Settings(windows=(1.5,), draws=4)
    alone, both = (identify(start, logs, SCALED, settings=settings) for logs in (light, [light[0], heavy]))

    def mass(result: Identification) -> tuple[float, float]:
        (found,) = [e for e in result.estimates if e.path == "section.1.mass"]
        return found.interval

    assert not any(e.identified for e in alone.estimates)
    assert any("only their ratios" in text for text in alone.warnings)
    assert all(e.identified for e in both.estimates)
    low, high = mass(both)
    assert low < 0.75 < high
    assert high - low < 0.2 * np.subtract(*mass(alone)[::-1])
    assert high - low < 0.2
    assert any("told by what is known to differ" in note for note in both.notes)
    # What is written is the arm without the payload.
    assert not both.parameters().effects


@pytest.mark.parametrize(
    "changes",
    [
        {"section.1.payload": 0.3, "section.1.payload.x": 0.05},
        {"base.rotation.y": np.pi / 2},
        {"gravity.x": 9.81, "gravity.z": 0.0},
    ],
)
def test_a_log_is_predicted_under_its_condition(changes: dict[str, float]) -> None:
    arm = one_section()
    log = measured(under(arm, changes), multisine(arm, 3.0, 50.0, 4), seed=3)
    right, wrong = (predict(arm, [record(arm, log, changes=known)])[0] for known in (changes, {}))
    assert right.rms == pytest.approx(right.record.noise, rel=0.3)
    assert np.max(wrong.rms / right.rms) > 3.0


def test_rest_lengths_of_two_days(tmp_path: Path) -> None:
    """The arm was taken apart: its rest length is 4 mm longer in May, all else is shared, and the files say so."""
    arm = one_section()
    longer = bha.Arm(arm.with_values({"section.1.rest_length": 0.154}).parameters)
    for name, own, seed in (("april", arm, 1), ("may", longer, 2), ("may_2", longer, 3)):
        measured(own, multisine(arm, 3.0, 50.0, seed), seed=seed).write(tmp_path / f"{name}.csv")
    off(arm, {"section.1.stiffness.1": 1.1, "section.1.damping": 0.9}).save(tmp_path / "arm.toml")
    arguments = ["identify", str(tmp_path / "arm.toml"), str(tmp_path / "april.csv"), str(tmp_path / "may.csv")]
    arguments += ["--holdout", str(tmp_path / "may_2.csv"), "--windows", "1.5", "--out", str(tmp_path / "out.toml")]
    arguments += ["--free", "section.1.stiffness.1", "--free", "section.1.damping"]
    arguments += ["--session", "april=april.csv", "--session", "may=may.csv,may_2.csv"]
    done = CliRunner().invoke(main, [*arguments, "--per-session", "section.1.rest_length", "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["sessions"] == {"april": ["april.csv"], "may": ["may.csv"]}
    values = {tuple(p["sessions"]): p for p in found["parameters"] if p["path"] == "section.1.rest_length"}
    for session, true in (("april", 0.15), ("may", 0.154)):
        own = values[session,]
        assert own["standard_error"] < 2e-4
        assert abs(own["value"] - true) < 4.0 * own["standard_error"]
        section = ArmParameters.read(tmp_path / f"out_{session}.toml").sections[0]
        entry = section.provenance["rest_length"]
        assert section.rest_length == pytest.approx(own["value"])
        assert [log.name for log in entry.logs] == [f"{session}.csv"]
        assert entry.source == f"of session {session}: rest length of section 1"
        assert [log.name for log in section.provenance["damping"].logs] == ["april.csv", "may.csv"]
    assert not (tmp_path / "out.toml").exists()
    (held,) = found["held_out"]
    assert np.all(np.array(held["rms_after"]) < 1.3 * np.array(held["noise"]))
    assert any("all else is shared" in note for note in found["notes"])


@pytest.mark.parametrize(
    ("extra", "text"),
    [
        (["--with", "x.csv", "gravity.x=1"], "--with x.csv: not among the logs"),
        (["--with", "a.csv", "gravity.x"], "PATH=NUMBER is needed"),
        (["--with", "a.csv", "gravity.w=1"], "nearest allowed: 'gravity."),
        (["--with", "a.csv", "section.2.payload=1"], "the arm has sections 1 to 1"),
        (["--with", "a.csv", "section.1.payload.x=0.1"], "its mass is not"),
        (["--with", "a.csv", "section.1.mass=0.9"], "section.1.mass is free (as section.1.mass) and known for a log"),
        (["--with", "a.csv", "gravity.x=1,gravity.x=2"], "stated twice"),
        (["--session", "april"], "NAME=LOG,LOG is needed"),
        (["--session", "a/b=a.csv"], "letters, digits"),
        (["--session", "x=a.csv", "--session", "y=a.csv"], "of session x and of session y"),
        (["--per-session", "section.1.rest_length"], "name its session"),
        (["--per-session", "section.1.rest_length", "--session", "x=a.csv,b.csv"], "all logs are of session x"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path: Path, extra: list[str], text: str) -> None:
    arm = one_section()
    for seed, name in enumerate(("a.csv", "b.csv")):
        measured(arm, multisine(arm, 2.0, 50.0, seed), seed=seed).write(tmp_path / name)
    arm.save(tmp_path / "arm.toml")
    logs = [str(tmp_path / name) for name in ("a.csv", "b.csv")]
    arguments = ["identify", str(tmp_path / "arm.toml"), *logs, "--free", "section.1.mass"]
    done = CliRunner().invoke(main, [*arguments, "--out", str(tmp_path / "out.toml"), *extra])
    assert done.exit_code == 1, done.output
    assert text in done.output
    assert not list(tmp_path.glob("out*"))


def test_sessions_of_a_free_parameter_keep_its_prior() -> None:
    """What is named for sessions keeps bounds and prior of the shared one."""
    from bha.identification.arranged import by_session  # noqa: PLC0415

    arm = one_section()
    logs = [measured(arm, multisine(arm, 1.0, 50.0, seed), seed=seed) for seed in (1, 2)]
    records = [record(arm, log, session=name) for log, name in zip(logs, ("a", "b"), strict=True)]
    shared = FreeParameter("section.1.rest_length", lower=0.14, prior=(0.15, 0.005))
    kept = by_session([shared, "section.1.mass"], ["section.1.rest_length"], records, [])
    assert [(f.path, f.sessions, f.lower, f.prior) for f in kept] == [
        ("section.1.mass", (), None, None),
        ("section.1.rest_length", ("a",), 0.14, (0.15, 0.005)),
        ("section.1.rest_length", ("b",), 0.14, (0.15, 0.005)),
    ]
