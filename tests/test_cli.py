"""The commands as one types them: what they print and write, and what they say about wrong files."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

import bha
from bha.cli import COMMANDS, main

NAMES = bha.robots.load("bha_nominal").inputs
HEADER = ",".join(["t [s]", *(f"{name} [bar]" for name in NAMES)])
ROWS = ["0" + ",1.1" * 9, "0.1" + ",1.3" * 9, "0.2" + ",1.3" * 9]


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def log(folder: Path, rows: list[str] | None = None, header: str = HEADER) -> Path:
    path = folder / "log.csv"
    path.write_text("\n".join([header, *(ROWS if rows is None else rows)]) + "\n")
    return path


def test_help_names_every_command_and_each_has_its_own() -> None:
    listed = run("--help").output
    for name in COMMANDS:
        assert name in listed
        result = run(name, "--help")
        assert result.exit_code == 0, result.output
        assert "Usage:" in result.output


def test_info_for_people_and_machines() -> None:
    assert "p33" in run("info", "bha_nominal", "--json").output
    facts = json.loads(run("info", "bha_nominal", "--json").output)
    arm = bha.robots.load("bha_nominal")
    np.testing.assert_allclose(np.ravel(facts["rest_lengths"]), arm.static_lengths(np.full(9, 101_325.0)))
    assert facts["mass"] == pytest.approx(sum(s.mass for s in arm.parameters.sections))
    text = run("info", "bha_nominal")
    assert text.exit_code == 0
    assert "assumed" in text.output


def test_info_has_units() -> None:
    values = json.loads(run("info", "bha_nominal", "--json").output)["values"]
    units = {value["key"]: value["unit"] for value in values}
    assert (units["mass"], units["damping"], units["gravity"], units["fill_time"]) == ("kg", "N s/m", "m/s^2", "s")
    line = next(line for line in run("info", "bha_nominal").output.splitlines() if "damping" in line)
    assert [cell.strip() for cell in line.strip("│|").replace("|", "│").split("│")][1:4] == ["damping", "18", "N s/m"]


@pytest.mark.parametrize("command", [("info",), ("simulate", "--input", "log.csv"), ("control",), ("excite",)])
def test_a_misspelt_arm_is_answered_with_the_nearest(command: tuple[str, ...]) -> None:
    result = run(command[0], "bha_nominl", *command[1:])
    assert result.exit_code == 1
    assert "bha_nominl: there is no such file, and no arm of that name; nearest allowed: 'bha_nominal'" in result.output
    assert "bha robots" in result.output
    assert "nearest" not in run(command[0], "xyz", *command[1:]).output
    assert "xyz.toml: there is no such file\n" in run(command[0], "xyz.toml", *command[1:]).output


def test_a_misspelt_plant_too() -> None:
    result = run("control", "bha_nominal", "--plant", "asu_two_section_jan")
    assert result.exit_code == 1
    assert "'asu_two_section_january'" in result.output


def test_robots_lists_what_ships() -> None:
    found = {entry["name"]: entry for entry in json.loads(run("robots", "--json").output)["robots"]}
    assert tuple(found) == bha.robots.names()
    assert found["bha_nominal"]["bellows"] == [3, 3, 3]
    assert not found["bha_nominal"]["stiff"]
    # RK4 is stable to 2.785 over a damped rate, the fastest of its linearization is 122.5 1/s; with a reserve.
    assert 0.5 * 2.785 / 122.509 < found["bha_nominal"]["explicit_step"] < 2.785 / 122.509
    assert found["asu_two_section_january"]["stiff"]
    assert found["asu_two_section"]["bellows"] == [4, 4]
    assert "Bionic Handling Assistant" in found["bha_nominal"]["about"]
    assert found["bha_nominal"]["values"]["published"] == 6
    text = run("robots").output
    for name in bha.robots.names():
        assert name in text


def lengths(path: Path) -> NDArray[np.float64]:
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return np.array(arrays["lengths"])
    measured = bha.Log.read(path).lengths
    assert measured is not None
    return measured


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet", ".npz"])
def test_simulate_writes_what_the_python_interface_computes(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("pyarrow")
    path, out = log(tmp_path), tmp_path / f"out{suffix}"
    result = run("simulate", "bha_nominal", "--input", path, "--out", out, "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.output)
    assert said["rows"] == 21
    assert said["method"] == "dopri5"
    assert said["written"] == [str(out)]
    expected = bha.simulate(bha.robots.load("bha_nominal"), bha.Log.read(path))
    np.testing.assert_allclose(lengths(out), expected.lengths, rtol=1e-9)


def test_simulate_draws(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    result = run("simulate", "bha_nominal", "--input", log(tmp_path), "--dt", "0.01", "--plot")
    assert result.exit_code == 0, result.output
    assert {p.name for p in tmp_path.glob("*.png")} == {"log_trajectory.png", "log_shape.png"}


def test_without_a_reading_to_compare_with_no_table_of_nothing_is_shown(tmp_path: Path) -> None:
    rows = ["0," + row.split(",", 1)[1] + ",0.3" for row in ROWS]
    result = run("simulate", "bha_nominal", "--input", log(tmp_path, rows, f"{HEADER},q11 [m]"))
    assert result.exit_code == 0, result.output
    assert "nothing is compared" in result.output
    assert "nan" not in result.output


def test_errors_against_measured_heads_are_root_mean_squares(tmp_path: Path) -> None:
    arm = bha.robots.load("bha_nominal")
    source = bha.Log.read(log(tmp_path))
    exact = bha.simulate(arm, source, times=source.time)
    heads = exact.head_positions + np.array([1e-3, 2e-3, 3e-3])
    columns = [f"{axis}{head} [m]" for head in (1, 2, 3) for axis in "xyz"]
    rows = [",".join([row, *map(repr, np.ravel(h).tolist())]) for row, h in zip(ROWS, heads, strict=True)]
    path = log(tmp_path, rows, ",".join([HEADER, *columns]))
    said = json.loads(run("simulate", "bha_nominal", "--input", path, "--json").output)
    np.testing.assert_allclose(said["head_error_rms"], np.tile([1e-3, 2e-3, 3e-3], (3, 1)), atol=1e-8)
    np.testing.assert_allclose(said["head_error_max"], np.tile([1e-3, 2e-3, 3e-3], (3, 1)), atol=1e-8)


ARM = Path(bha.robots.__file__).parent / "bha_nominal.toml"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("mass", "masss"), ["masss", "section"]),
        (("schema", "# schema"), ["schema", "bha-arm/1"]),
        (('"end_force"', '"endforce"'), ["force_model", "endforce", "work_conjugate"]),
        (("[[section]]", "[[section]"), ["line"]),
    ],
)
def test_wrong_parameter_files(tmp_path: Path, change: tuple[str, str], said: list[str]) -> None:
    path = tmp_path / "arm.toml"
    text = ARM.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    result = run("info", path)
    assert result.exit_code == 1
    assert result.output.startswith("error: ")
    for word in [str(path), *said]:
        assert word in result.output, result.output
    assert "Traceback" not in result.output


@pytest.mark.parametrize(
    ("rows", "header", "said"),
    [
        ([], HEADER, ["no rows"]),
        (["0" + ",1.1" * 9, "0.1" + ",nan" * 9], HEADER, ["line 3", "p11"]),
        (["0.1" + ",1.1" * 9, "0" + ",1.1" * 9], HEADER, ["line 3", "t"]),
        (["0" + ",1.1" * 8, "0.1" + ",1.1" * 8], HEADER.rpartition(",")[0], ["p33"]),
        (["0" + ",1.1" * 9, "0.1,1.1"], HEADER, ["line 3"]),
        (["0" + ",1.1" * 9, "0.1" + ",high" * 9], HEADER, ["line 3", "high"]),
        (ROWS, HEADER.replace("p11 [bar]", "p11 [m]"), ["p11", "[m]"]),
        (ROWS, HEADER.replace("p11 [bar]", "p11 [barr]"), ["p11", "barr"]),
    ],
)
def test_wrong_logs(tmp_path: Path, rows: list[str], header: str, said: list[str]) -> None:
    path, out = log(tmp_path, rows, header), tmp_path / "out.csv"
    result = run("simulate", "bha_nominal", "--input", path, "--out", out)
    assert result.exit_code == 1, result.output
    assert result.output.startswith("error: ")
    for word in [path.name, *said]:
        assert word in result.output, result.output
    assert not out.exists()


def test_files_that_are_not_there_or_not_what_they_claim(tmp_path: Path) -> None:
    path = log(tmp_path)
    for arguments in (
        ("info", tmp_path / "none.toml"),
        ("info", "no_such_arm"),
        ("info", tmp_path),
        ("simulate", "bha_nominal", "--input", tmp_path / "none.csv"),
        ("simulate", "bha_nominal", "--input", tmp_path),
        ("simulate", "bha_nominal", "--input", ARM),
        ("simulate", "bha_nominal", "--input", path, "--out", tmp_path / "out.xyz"),
        ("simulate", "bha_nominal", "--input", path, "--out", tmp_path / "nowhere" / "out.csv"),
        ("simulate", "bha_nominal", "--input", path, "--dt", "0"),
        ("simulate", "bha_nominal", "--input", path, "--method", "rk4", "--step", "-1"),
        ("simulate", "bha_nominal", "--input", path, "--pressures", "commanded"),
    ):
        result = run(*arguments)
        assert result.exit_code in {1, 2}, (arguments, result.output)
        assert "rror" in result.output, (arguments, result.output)
        assert "Traceback" not in result.output
    for name, content in (
        ("not.parquet", b"PAR1 no"),
        ("not.csv.gz", b"\x1f\x8b broken"),
        ("binary.csv", bytes(range(256))),
    ):
        (tmp_path / name).write_bytes(content)
        result = run("simulate", "bha_nominal", "--input", tmp_path / name)
        assert result.exit_code == 1, (name, result.output)
        assert name in result.output
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception


def test_a_run_that_diverges_keeps_what_it_has_and_says_when(tmp_path: Path) -> None:
    """Far beyond the stability of RK4 at the given step."""
    out = tmp_path / "out.csv"
    path = log(tmp_path, [*ROWS, "20" + ",1.1" * 9])
    result = run(
        "simulate", "bha_nominal", "--input", path, "--out", out, "--method", "rk4", "--step", "0.03", "--dt", "0.03"
    )
    assert result.exit_code == 1
    assert "error: " in result.output
    kept = bha.Log.read(out)
    assert 0.0 < kept.time[-1] < 20.0
    assert np.isfinite(lengths(out)).all()


def test_tables_keep_the_units_of_their_headings(tmp_path: Path) -> None:
    assert "Head [mm]" in run("info", "bha_nominal").output


def test_experiments_keep_the_units_of_their_rows() -> None:
    assert "[kg]" in run("experiment", "table2").output


def test_more_steps_than_can_be_counted(tmp_path: Path) -> None:
    result = run("simulate", "bha_nominal", "--input", log(tmp_path), "--max-steps", "9" * 20)
    assert result.exit_code == 1
    assert f"max_steps: {'9' * 20}; allowed: 1 to {2**63 - 1}" in result.output


def test_lengths_beyond_the_files_limits_are_said_once(tmp_path: Path) -> None:
    rows = ["0" + ",1.1" * 9, "1,6,6" + ",1.1" * 7, "2,6,6" + ",1.1" * 7]
    result = run("simulate", "bha_nominal", "--input", log(tmp_path, rows))
    assert result.exit_code == 0, result.output
    said = [line for line in result.output.splitlines() if "length_range" in line]
    assert len(said) == 1
    assert said[0].startswith("warning: the simulated q11 reaches")
    assert "permitted are 100 to 300 mm" in said[0]
    assert "q12" in said[0]
    assert "length_range" not in run("simulate", "bha_nominal", "--input", log(tmp_path)).output
    arm = bha.robots.load("bha_nominal")
    with pytest.warns(bha.LogWarning, match=r"the simulated q11 reaches .* at .* s, permitted are 100 to 300 mm"):
        bha.simulate(arm, bha.Input.constant([3.5e5] + 8 * [1.1e5], 0.5))


def test_pressures_below_vacuum_are_refused() -> None:
    arm = bha.robots.load("bha_nominal")
    with pytest.raises(bha.InputError, match="pressures: element 0 is -1 Pa; pressures are absolute"):
        bha.Input.constant([-1.0] * 9, 1.0)
    falling = bha.Input(np.array([0.0, 1.0]), np.array([9 * [1e5], 8 * [1e5] + [-2e3]]))
    for run_ in (bha.simulate, bha.simulate_batch):
        with pytest.raises(bha.InputError, match=r"-2000 Pa.*gauge"):
            run_(arm, falling)
    with pytest.raises(bha.InputError, match="gauge pressure"):
        bha.simulate(arm, lambda _: np.full(9, -1.0), t_end=0.1)
