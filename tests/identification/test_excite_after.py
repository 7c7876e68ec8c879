"""What to measure after a fit: pieces that tell what it could not; and what is proposed goes through every command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.identification import FreeParameter, Identification, Settings, excite, identify
from bha.identification.design import chosen, untold_directions
from bha.parameters import ArmParameters

from .identify_logs import measured, one_section

FREE = ("section.1.mass", "section.1.stiffness.1", "section.1.bending_stiffness.1", "section.1.damping")
SETTINGS = Settings(windows=(None,), draws=0)
#: Of the lengths, m, and of the pressures, Pa: none of these, for it would shake the arm.
NOISE = {"noise": 2e-3, "pressure_noise": 1e-3}


def plain_arm() -> bha.Arm:
    """One section of linear springs whose inertia follows from its mass."""
    mapping = one_section().parameters.to_mapping()
    mapping["section"][0].pop("inertia")
    mapping["section"][0]["provenance"].pop("inertia")
    mapping["section"][0]["stiffness"] = [1600.0]
    return bha.Arm(ArmParameters.from_mapping(mapping))


def slowly(seconds: float = 10.0) -> bha.Input:
    """One slow cycle that bends the arm to both sides: nothing of its mass or damping shows."""
    time = np.arange(0.0, seconds, 0.02)
    wave = np.sin(2.0 * np.pi * time / seconds)
    return bha.Input(time, 1.25e5 + 1.5e4 * np.column_stack([wave, -wave, np.abs(wave)]))


@pytest.fixture(scope="module")
def result() -> Identification:
    """What a slow log tells: stiffness, and not the damping."""
    arm = plain_arm()
    return identify(arm, [measured(arm, slowly(), seed=1, **NOISE)], FREE, settings=SETTINGS)


def test_what_was_not_told_is_told_next(result: Identification) -> None:
    """The proposal has what a slow log lacks, and both logs together tell the damping as well as it says."""
    arm = plain_arm()
    (damping,) = [e for e in result.estimates if e.path == "section.1.damping"]
    assert not damping.identified
    # At the true arm, so that its prospects are those of the logs below; the estimate of the damping is far off.
    proposal = excite(arm, duration=10.0, rate=50.0, after=result)
    assert all(p.told for p in proposal.prospects)
    (prospect,) = [p for p in proposal.prospects if p.name == "section.1.damping"]
    assert prospect.before is not None
    assert prospect.standard_error < 0.2 * prospect.before
    drives = (slowly(), bha.Input(proposal.time, proposal.pressures))
    logs = [measured(arm, drive, seed=seed, **NOISE) for seed, drive in enumerate(drives, start=1)]
    both = identify(arm, logs, FREE, settings=SETTINGS)
    (told,) = [e for e in both.estimates if e.path == "section.1.damping"]
    assert told.identified
    assert told.value == pytest.approx(18.0, abs=4.0 * told.standard_error + 0.02 * 18.0)
    assert told.standard_error == pytest.approx(prospect.standard_error, rel=0.5)


def test_a_piece_that_tells_the_untold_direction_is_chosen() -> None:
    """Three coordinates, the third not told; only ``release`` tells it, another tells a lot about the first."""
    known = np.diag([100.0, 100.0, 0.0])
    tells = {"hold": np.diag([1e4, 0.0, 1e-9]), "release": np.diag([0.0, 1.0, 10.0])}
    assert np.abs(untold_directions(known)[:, 0]) == pytest.approx([0.0, 0.0, 1.0])
    first, second = chosen(known, ["hold", "release"], tells.__getitem__, 2)
    assert first == "release"
    assert second == "hold"  # the third is told by then: now what raises the information on all of them most
    # Where nothing tells it, rounding does not choose.
    assert chosen(known, ["hold"], tells.__getitem__, 1) == ["hold"]


def test_what_no_pressures_tell_a_known_mass_does(result: Identification) -> None:
    arm = plain_arm()
    free = [*FREE, "section.1.terminal_area"]
    proposal = excite(arm, duration=6.0, rate=50.0, free=free)
    assert "only their ratios" in proposal.unknown[0].text
    (text,) = proposal.advice
    assert "--with LOG section.1.payload=0.19" in text
    assert "section.1.mass to" in text
    assert excite(arm, duration=6.0, rate=50.0, free=FREE).advice == ()


def test_the_command_takes_what_identify_has_printed(result: Identification, tmp_path: Path) -> None:
    plain_arm().save(tmp_path / "arm.toml")
    measured(plain_arm(), slowly(6.0), seed=1).write(tmp_path / "slow.csv")
    free = [x for path in FREE for x in ("--free", path)]
    found = CliRunner().invoke(
        main,
        [
            "identify",
            *(str(tmp_path / name) for name in ("arm.toml", "slow.csv")),
            "--json",
            "--windows",
            "all",
            *free,
            "--out",
            str(tmp_path / "out.toml"),
        ],
    )
    (tmp_path / "result.json").write_text(found.stdout, encoding="utf-8")
    command = ["excite", str(tmp_path / "out.toml"), "--duration", "6", "--rate", "50", "--after"]
    done = CliRunner().invoke(main, [*command, str(tmp_path / "result.json"), "--json"])
    assert done.exit_code == 0, done.output
    proposal = json.loads(done.stdout)
    assert [p["name"] for p in proposal["parameters"]] == list(FREE)
    assert all(p["standard_error"] < p["before"] for p in proposal["parameters"])
    shown = CliRunner().invoke(main, [*command, str(tmp_path / "result.json")])
    assert "pieces: " in shown.output
    for name, text in (("arm.toml", "no JSON"), ("none.json", "no such file")):
        wrong = CliRunner().invoke(main, [*command, str(tmp_path / name)])
        assert wrong.exit_code == 1
        assert text in wrong.output.lower().replace("no json", "no JSON")
    (tmp_path / "other.json").write_text("{}", encoding="utf-8")
    wrong = CliRunner().invoke(main, [*command, str(tmp_path / "other.json")])
    assert "not a result of bha identify --json" in wrong.output


def test_defaults_are_those_of_a_fit_of_lengths() -> None:
    """What is judged by default is what would be free: published masses stay, areas are not free beside lengths."""
    mapping = one_section().parameters.to_mapping()
    mapping["section"][0].setdefault("provenance", {})["mass"] = {"status": "published", "source": "scale"}
    arm = bha.Arm(ArmParameters.from_mapping(mapping))
    names = [p.name for p in excite(arm, duration=4.0, rate=50.0).prospects]
    assert "section.1.mass" not in names
    assert "section.1.damping" in names
    assert FreeParameter("section.1.mass").name not in names


def test_commands_of_an_excitation_go_through_every_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Proposed, simulated, measured under commands, checked, identified, diagnosed, followed, swept; not renamed."""
    monkeypatch.chdir(tmp_path)

    def bha_(*arguments: str) -> str:
        done = CliRunner().invoke(main, list(arguments))
        assert done.exit_code == 0, done.output
        return done.output

    one_section().save("arm.toml")
    bha_("excite", "arm.toml", "--duration", "8", "--rate", "50", "--out", "commands.csv")
    bha_("simulate", "arm.toml", "--input", "commands.csv", "--out", "run.csv", "--dt", "0.02")
    commands, run = bha.Log.read("commands.csv"), bha.Log.read("run.csv")
    assert commands.columns == ("t", "pc11", "pc12", "pc13")
    random = np.random.default_rng(1)
    columns = {f"{name} [Pa]": commands[name] for name in commands.columns[1:]}
    for k in (1, 2, 3):
        columns[f"q1{k} [m]"] = run[f"q1{k}"] + 3e-4 * random.standard_normal(len(run))
    bha.Log.from_arrays({"t [s]": commands.time, **columns}).write("measured.csv")
    assert "0 faults" in bha_("check", "arm.toml", "measured.csv")
    found = json.loads(bha_("identify", "arm.toml", "measured.csv", "--free", "section.1.mass", "--json"))
    assert found["parameters"][0]["value"] == pytest.approx(0.75, rel=0.05)
    bha_("diagnose", "arm.toml", "measured.csv", "--out", "diagnosis", "--no-report")
    bha_("control", "arm.toml", "--reference", "run.csv", "--controller", "pid")
    sweep = (
        'schema = "bha-sweep/1"\narm = "arm.toml"\nkind = "monte_carlo"\nruns = 8\n[input]\nlogs = ["commands.csv"]\n'
    )
    sweep += '[[vary]]\nwhat = "section.1.mass"\nrelative = true\ndistribution = "uniform"\nlow = 0.9\nhigh = 1.1\n'
    Path("sweep.toml").write_text(sweep, encoding="utf-8")
    assert '"done": 8' in bha_("sweep", "sweep.toml", "--json")
