"""A new arm's file from a tape measure and a scale: it loads, stands as it was measured, and says what is odd."""

import itertools
import json
import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

import bha
from bha.cli import main
from bha.errors import ParameterError, ParameterWarning
from bha.parameters import ArmParameters, MeasuredArm, MeasuredSection, new_arm
from bha.parameters.guesses import guesses, toppling

AMBIENT, GREATEST = 101_325.0, 1.2e5
NEEDED = ["--length", "150mm", "--radius", "60mm", "--diameter", "50mm", "--mass", "0.5kg", "--pressure-max", "1bar"]


def run(*arguments: str | Path, answers: str | None = None) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments], input=answers)


def loaded(measured: MeasuredArm) -> bha.Arm:
    """The arm of a new file; any warning fails."""
    return bha.Arm.from_parameters(ArmParameters.from_toml(new_arm(measured)))


def measured(mounting: str, bellows: int, count: int, mass: float, **changes: float) -> MeasuredArm:
    diameter = min(0.04, 0.1 * math.sin(math.pi / bellows))
    sections = tuple(
        MeasuredSection(0.15 - 0.02 * i, 0.05, diameter, mass, bellows=bellows, first_angle_deg=20.0 * i, **changes)
        for i in range(count)
    )
    return MeasuredArm("grid", sections, GREATEST, mounting=mounting)  # type: ignore[arg-type]


GRID = list(itertools.product(("hanging", "lying", "upright"), (3, 4, 7, 12), (1, 3), (0.1, 0.3)))


@pytest.mark.parametrize(("mounting", "bellows", "count", "mass"), GRID)
def test_the_arm_stands_as_it_was_measured(mounting: str, bellows: int, count: int, mass: float) -> None:
    given = measured(mounting, bellows, count, mass)
    arm = loaded(given)
    n = len(arm.inputs)
    for gauge, names in ((0.0, "length"), (GREATEST, "resolved_longest")):
        means = arm.static_lengths(np.full(n, AMBIENT + gauge)).reshape(-1, 3).mean(axis=1)
        wanted = [getattr(section, names) for section in given.sections]
        # Guesses have four digits. Sections of an arm that lies are bent, and bear a part of the weight lengthwise.
        np.testing.assert_allclose(means, wanted, rtol=5e-4 if mounting != "lying" else 0.05)
    low = min(section.length_range[0] for section in arm.parameters.sections)
    high = max(section.length_range[1] for section in arm.parameters.sections)
    for driven in range(n):
        pressures = np.full(n, AMBIENT)
        pressures[driven] += GREATEST
        q = arm.static_lengths(pressures)
        assert low < q.min() < q.max() < high
        # The bellows with pressure is the longest of its section: the arm bends away from it.
        section = driven // bellows
        angle = arm.parameters.sections[section].resolved_bellows(section + 1)[driven % bellows].angle
        own = q.reshape(-1, 3)[section]
        pull = sum((own[k] - own.mean()) * math.cos(angle - 2 * math.pi * k / 3) for k in range(3))
        assert pull > 0.0 or mounting == "lying"


@pytest.mark.parametrize("bellows", [2, 3, 5])
def test_two_bellows_and_vacuum_too(bellows: int) -> None:
    section = MeasuredSection(0.15, 0.05, 0.04, 0.3, longest=0.2, bellows=bellows, base_offset=0.01, head_offset=0.02)
    arm = loaded(MeasuredArm("short", (section,), GREATEST, pressure_min=-0.5e5))
    q = arm.static_lengths(np.full(bellows, AMBIENT - 0.5e5))
    low, high = arm.parameters.sections[0].length_range
    assert low < q.min() <= q.max() < 0.15 < high
    assert arm.forward_kinematics(q)[0][0, 2] == pytest.approx(q.mean() + 0.03)
    assert arm.parameters.sections[0].pressure_range == (51_325.0, 221_325.0)


def test_the_weight_topples_an_upright_arm_as_heights_say() -> None:
    """Second derivatives of the heads' heights, against those of the poses that the core computes."""
    sections = (
        MeasuredSection(0.15, 0.05, 0.04, 0.3, base_offset=0.02, head_offset=0.03),
        MeasuredSection(0.11, 0.04, 0.03, 0.2, base_offset=0.01, head_offset=0.05),
    )
    given = MeasuredArm("tower", sections, GREATEST, mounting="upright")
    arm = loaded(given)

    def weight(angles: NDArray[np.float64]) -> float:
        directions = np.cos(np.deg2rad([0.0, 120.0, 240.0]))
        q = [s.length - s.radius * psi * directions for s, psi in zip(sections, angles, strict=True)]
        heads = arm.forward_kinematics(np.ravel(q))[0]
        return float(sum(9.81 * s.mass * z for s, z in zip(sections, heads[:, 2], strict=True)))

    h, found = 1e-3, np.empty((2, 2))
    for i, j in np.ndindex(2, 2):
        a, b = h * np.eye(2)[i], h * np.eye(2)[j]
        found[i, j] = -(weight(a + b) - weight(a - b) - weight(b - a) + weight(-a - b)) / (4 * h * h)
    np.testing.assert_allclose(toppling(given), found, rtol=1e-4)


def test_an_upright_arm_that_falls_over_is_said_and_does_not_stand() -> None:
    heavy = MeasuredArm("tower", (MeasuredSection(0.3, 0.02, 0.02, 3.0, longest=0.5),) * 2, 2e5, mounting="upright")
    with pytest.warns(ParameterWarning) as told:
        text = new_arm(heavy)
    assert any("would bend aside under its own weight" in str(w.message) for w in told)
    arm = bha.Arm(ArmParameters.from_toml(text))
    start = np.full(6, 0.3)
    start[0] += 1e-4
    run = bha.simulate(arm, bha.Input(np.array([0.0, 1.5]), np.full((2, 6), AMBIENT)), q0=start)
    assert np.abs(run.lengths[-1].reshape(2, 3) - run.lengths[-1].reshape(2, 3).mean(axis=1)[:, None]).max() > 0.005


def test_what_is_guessed_says_by_what_rule() -> None:
    parameters = ArmParameters.from_toml(new_arm(measured("hanging", 4, 2, 0.3)))
    for section in parameters.sections:
        origins = {key: entry.status for key, entry in section.provenance.items()}
        assert {key for key, status in origins.items() if status == "assumed"} == {
            "terminal_area", "rest_length", "stiffness", "damping", "bending_stiffness", "length_range",
        }  # fmt: skip
        assert all(section.provenance[key].source for key, status in origins.items() if status == "assumed")
        assert origins["mass"] == origins["bellows_radius"] == "measured"
    stated = ArmParameters.from_toml(new_arm(measured("hanging", 3, 1, 0.3, area=1.5e-3))).sections[0]
    assert stated.terminal_area == 1.5e-3
    assert stated.provenance["terminal_area"].status == "measured"


def test_the_rules_by_hand() -> None:
    (guess,) = guesses(MeasuredArm("one", (MeasuredSection(0.15, 0.05, 0.04, 0.5, longest=0.2),), 1e5))
    area = 0.9 * math.pi * 0.02**2
    assert guess.terminal_area == pytest.approx(area)
    assert guess.stiffness == pytest.approx(area * 1e5 / 0.05)
    assert guess.rest_length == pytest.approx(0.15 - 0.5 * 9.81 / (3 * guess.stiffness))
    assert guess.bending_stiffness == pytest.approx(3 * guess.stiffness * 0.038**2 / 8)
    axial = 3 * guess.stiffness
    assert 3 * guess.damping / (2 * math.sqrt(axial * 0.5)) == pytest.approx(0.3)


def test_comments_line_up() -> None:
    table: list[int] = []
    for line in new_arm(measured("lying", 4, 2, 0.1, head_offset=0.01)).splitlines():
        if line.startswith("#"):
            continue
        if not line or line.startswith("["):
            table = []
        elif "  # " in line:
            table.append(line.index("  # "))
            assert len(set(table)) == 1, line
            assert len(line) <= 120
        else:
            assert "#" not in line


def test_a_file_by_options(tmp_path: Path) -> None:
    path = tmp_path / "my_arm.toml"
    result = run("new", path, *NEEDED, "--sections", "2", "--head-offset", "0.02,0", "--bellows", "3,4")
    assert result.exit_code == 0, result.output
    assert result.output == f"Written: {path}. Next: bha info {path}\n"
    first, second = ArmParameters.read(path).sections
    assert (first.head_offset, second.head_offset) == (0.02, 0.0)
    assert (len(first.bellows or ()), len(second.bellows or ())) == (3, 4)
    assert first.pressure_range == (AMBIENT, 201_325.0)
    told = json.loads(run("info", path, "--json").output)
    assert told["name"] == "my_arm"
    assert any(value["status"] == "assumed" and "mean diameter" in (value["source"] or "") for value in told["values"])
    assert "assumed: 0.9 of the circle" in run("info", path).output


def test_a_log_of_the_new_arm_is_checked_against_it(tmp_path: Path) -> None:
    path = tmp_path / "my_arm.toml"
    assert run("new", path, *NEEDED).exit_code == 0
    waves = [f"{t / 20},{30 + 30 * math.sin(t / 9)},{30 + 30 * math.sin(t / 7)},0" for t in range(600)]
    drive = tmp_path / "drive.csv"
    drive.write_text("\n".join(["t [s],p11 [kPa(g)],p12 [kPa(g)],p13 [kPa(g)]", *waves]) + "\n")
    out = tmp_path / "run.csv"
    assert run("simulate", path, "--input", drive, "--out", out).exit_code == 0
    assert "0 faults, 0 warnings" in run("check", path, out).output


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text("mine")
    for options in (NEEDED, ["--from", "bha_nominal"], []):
        result = run("new", path, *options)
        assert result.exit_code == 1
        assert "is there already" in result.output
        assert path.read_text() == "mine"
    assert run("new", path, *NEEDED, "--force").exit_code == 0
    assert ArmParameters.read(path).name == "arm"


def test_by_questions(tmp_path: Path) -> None:
    path = tmp_path / "asked.toml"
    # Mounting, pressures, sections, bellows, angle, length (400 m is not meant), longest, radius ..., as proposed.
    answers = ["lying", "1.5bar", "", "1", "4", "45", "400", "n", "400mm", "", "40 mm", "3.5cm", "430g", "", "20mm"]
    result = run("new", path, answers="\n".join(answers) + "\n")
    assert result.exit_code == 0, result.output
    assert "is 400 mm meant?" in result.output
    parameters = ArmParameters.read(path)
    (section,) = parameters.sections
    assert parameters.gravity == (9.81, 0.0, 0.0)
    assert (section.mass, section.bellows_radius, section.head_offset) == (0.43, 0.04, 0.02)
    assert [round(math.degrees(b.angle)) for b in section.resolved_bellows(1)] == [45, 135, 225, 315]
    assert "1.5 times" in (section.provenance["stiffness"].source or "")


def test_unanswered_questions_write_nothing(tmp_path: Path) -> None:
    result = run("new", tmp_path / "asked.toml", answers="hanging\n1bar\n")
    assert result.exit_code == 1
    assert "not answered to the end" in result.output
    assert not list(tmp_path.iterdir())


def test_from_another_arm(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert run("new", path, "--from", "asu_two_section").exit_code == 0
    mine, theirs = ArmParameters.read(path), bha.robots.parameters("asu_two_section")
    assert mine.name == "mine"
    assert mine.updated({"name": theirs.name}) == theirs
    assert "RISE Lab" in path.read_text()
    result = run("new", tmp_path / "other.toml", "--from", "asu_two_section", "--mass", "1kg")
    assert "found --from and --mass" in result.output
    assert "nearest allowed: 'bha_nominal'" in run("new", tmp_path / "x", "--from", "bha_nominl").output


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (["--length", "0.4mm", "--longest", "0.6mm", "--mass", "1g"], "length: 0.4 mm is not what arms have"),
        (["--length", "150"], "is 150 mm meant?"),
        (["--mass", "40"], "mass: 40 kg is not what arms have, 0.005 kg to 15 kg"),
        (["--pressure-max", "1.0"], "is 1 bar meant?"),
        (["--diameter", "150mm"], "3 bellows of 150 mm have no room side by side"),
        (["--longest", "151mm"], "1.01 times the length"),
        (["--radius", "5mm", "--diameter", "8mm", "--mass", "20g"], "one bellows alone would bend it by"),
        (["--mounting", "lying", "--mass", "4kg", "--diameter", "20mm", "--radius", "20mm"], "degrees as it lies"),
    ],
)
def test_what_is_implausible_is_said(tmp_path: Path, change: list[str], said: str) -> None:
    result = run("new", tmp_path / "odd.toml", *NEEDED, *change)
    assert f"{said}" in result.output
    assert "warning: odd: " in result.output
    assert "Traceback" not in result.output


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (["--length", "0"], "length: found 0.0; allowed: a finite number > 0 (m)"),
        (["--longest", "100mm"], "longest: found 0.1 m; allowed: more than the length"),
        (["--mass", "400kg"], "more than their length of 150 mm"),
        (["--mass", "0.5kg,0.4kg,0.3kg", "--sections", "2"], "--mass: found 3 values; allowed: one, or one for each"),
        (["--length", "150 bar"], "unit 'bar' does not fit; expected a length"),
        (["--length", "fifteen"], "expected a number, with its unit"),
        (["--length", "1e999"], "expected a finite number"),
        (["--pressure-max", "2bar(a)"], "expected gauge pressure"),
        (["--pressure-min", "-2bar"], "gauge pressure from -101325.0 (vacuum) to 0 Pa"),
        (["--bellows", "1"], "1 is not in the range 2<=x<=12"),
        (["--mounting", "sideways"], "'sideways' is not one of"),
    ],
)
def test_what_cannot_be_is_an_error(tmp_path: Path, change: list[str], said: str) -> None:
    result = run("new", tmp_path / "wrong.toml", *NEEDED, *change)
    assert result.exit_code in (1, 2)
    assert said in result.output.replace("\n", " ")
    assert not list(tmp_path.iterdir())


def test_missing_options_are_named(tmp_path: Path) -> None:
    result = run("new", tmp_path / "some.toml", "--mass", "1kg")
    assert "--length, --radius, --diameter, --pressure-max not given" in result.output
    assert "does not exist" in run("new", tmp_path / "no" / "some.toml", *NEEDED).output


def test_every_fault_is_named() -> None:
    section = MeasuredSection(-1.0, float("nan"), 0.04, 0.3, bellows=99, first_angle_deg=float("inf"))
    with pytest.raises(ParameterError) as error:
        new_arm(MeasuredArm("wrong", (section,), float("inf"), mounting="askew"))  # type: ignore[arg-type]
    for key in ("length", "radius", "bellows", "first_angle_deg", "pressure_max", "mounting"):
        assert f"{key}: found" in str(error.value)
    with pytest.raises(ParameterError, match="sections: found 0"):
        new_arm(MeasuredArm("none", (), 1e5))


def test_a_name_with_quotes_stays() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        text = new_arm(MeasuredArm('a "b" \\ c', (MeasuredSection(0.15, 0.05, 0.04, 0.3),), 1e5))
    assert ArmParameters.from_toml(text).name == 'a "b" \\ c'
