"""Headings of logs: what is almost right is proposed, what is absurd ends at once, what is doubtful is said."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bha import Log
from bha.errors import LogError, LogWarning
from bha.logs.units import doubt


def read(folder: Path, text: str | bytes) -> Log:
    path = folder / "log.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return Log.read(path)


def fault(folder: Path, text: str | bytes) -> str:
    with pytest.raises(LogError) as caught:
        read(folder, text)
    return str(caught.value).replace(f"{folder / 'log.csv'}", "FILE")


@pytest.mark.parametrize(
    ("unit", "meant"),
    [
        *(("psig", "psi(g)"), ("barg", "bar(g)"), ("kPag", "kPa(g)"), ("kPa(gauge)", "kPa(g)"), ("psia", "psi(a)")),
        *(("bara", "bar(a)"), ("kPa(abs)", "kPa(a)"), ("PSI(g)", "psi(g)"), ("kpa(g)", "kPa(g)"), ("PSI", "psi")),
        *(("pa", "Pa"), ("psi gauge", "psi(g)"), ("mbar_abs", "mbar(a)"), ("bar rel", "bar(g)"), ("MBAR", "mbar")),
    ],
)
def test_units_of_pressure_get_proposals(unit: str, meant: str, tmp_path: Path) -> None:
    found = fault(tmp_path, f"t [s],p11 [{unit}]\n0,1\n")
    assert found.startswith(f"FILE: column 'p11 [{unit}]': unit '{unit}' ")
    assert found.endswith(f"; did you mean '{meant}'?")


@pytest.mark.parametrize(
    ("heading", "meant"),
    [("q11 [MM]", "mm"), ("t [S]", "s"), ("t [msec.]", None), ("q11 [kg]", None), ("fx1 [n]", "N"), ("fx1 [nn]", "N")],
)
def test_other_units_get_proposals_where_one_is_near(heading: str, meant: str | None, tmp_path: Path) -> None:
    found = fault(tmp_path, f"{heading}{'' if heading.startswith('t ') else ',t [s]'}\n0,1\n")
    assert ("did you mean" in found) == (meant is not None)
    assert meant is None or found.endswith(f"did you mean '{meant}'?")


@pytest.mark.parametrize(
    ("heading", "meant"),
    [
        *(("Time (s)", "t [s]"), ("time [ms]", "t [ms]"), ("Time", "t [s]"), ("Time (Seconds)", "t [s]")),
        *(("timestamp (us)", "t [us]"), ("time_s", "t [s]"), ("# t [s]", "t [s]")),
    ],
)
def test_a_time_of_another_name_gets_a_proposal(heading: str, meant: str, tmp_path: Path) -> None:
    found = fault(tmp_path, f"{heading},p11 [Pa]\n0,1\n")
    assert found.startswith("FILE: there is no column of time, 't [s]'; ")
    assert found.endswith(f"column '{heading}' is not known; did you mean '{meant}'? Rename it")


@pytest.mark.parametrize(
    ("above", "line", "next_line"),
    [
        ("sep=,\n", 1, 2),
        ("# made on a Monday\n", 1, 2),
        ("\n# made on a Monday\n\n\n", 2, 5),
        ("Format Version,1.23,Take Name,Take 1,Frames,120,120\r\n\r\n,Type,Rigid\r\n", 1, 4),
        ("operator;somebody\n", 1, 2),
    ],
)
def test_lines_above_the_headings_are_passed_over_or_named(
    above: str, line: int, next_line: int, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(above + "t [s],p11 [Pa(g)]\n0,1\n")
    (note,) = Log.read(path).notes
    assert f"headings in line {next_line}, numbers from line {next_line + 1} on" in note
    # Where no numbers follow nothing says that these are headings.
    found = fault(tmp_path, above + "t [s],p11 [Pa]\nzero,one\n")
    assert found.startswith(f"FILE, line {line} is no line of headings: found '")
    assert found.endswith(f"'; they seem to begin in line {next_line}: remove the lines above it")


def test_lines_above_headings_of_another_kind(tmp_path: Path) -> None:
    assert "column 'Frame'" not in fault(tmp_path, "made,1\nby,2\nFrame,Time (Seconds),X\n0,1,2\n")
    assert "did you mean 't [s]'" in fault(tmp_path, "made,1\nby,2\nFrame,Time (Seconds),X\n0,1,2\n")
    assert fault(tmp_path, "sep=,\n1,2\n").endswith("found 'sep=,'; remove the lines above the headings")
    for line in ('"t [s],p11 [Pa]"', '"t [s],p11 [Pa]'):
        assert "line 1: all headings stand in one pair of quotes, or a quote is not" in fault(
            tmp_path, f"{line}\n0,1\n"
        )
    assert fault(tmp_path, "0,1e5\n0.1,1e5\n").endswith(
        "line 1 is no line of headings: found '0,1e5', which are numbers; write the columns' names and units above "
        "them, such as 't [s]', 'p11 [kPa(g)]', 'q11 [mm]'"
    )
    assert fault(tmp_path, "a;b\n1;2\n") == "FILE: there is no column of time, 't [s]'; the log has: a, b"
    assert "line 1: the headings are separated by '\\t'; exp" in fault(tmp_path, "t [s]\tp11 [Pa]\n0\tone\n")
    assert fault(tmp_path, "a,b\n1,2\n") == "FILE: there is no column of time, 't [s]'; the log has: a, b"


@pytest.mark.parametrize(
    ("heading", "expected"),
    [
        ("x99999999 [m]", "section 99999999; sections, bellows and inputs count from 1 to 999"),
        ("fx1000 [N]", "section 1000; sections"),
        ("q99999999_1 [m]", "section 99999999; sections"),
        ("p1_1000 [Pa]", "number 1000; sections"),
        (
            f"p1_{'9' * 5000} [Pa]",
            "the heading of column 2, 'p1_9999999999999999999999999999999999999...', has 5008 char",
        ),
        (
            f"p11{' ' * 20000}[Pa{' ' * 20000}(x",
            "has 40008 characters; a heading, such as 'p11 [kPa(g)]', has at most 200",
        ),
        (f"p11{' ' * 90}[Pa{' ' * 90}(x", "is not known; did you mean 'p11 [Pa]'? Rename it"),
        ("p11 [kPa] (g)", "column 'p11 [kPa] (g)' is not known; did you mean 'p11 [kPa(g)]'? Rename it"),
        ("P_11 [kPag]", "column 'P_11 [kPag]' is not known; did you mean 'p11 [kPa(g)]'? Rename it"),
        ("p11 kPa", "column 'p11 kPa' is not known; did you mean 'p11 [kPa]'? Rename it"),
        ("q11_mm", "column 'q11_mm' is not known; did you mean 'q11 [mm]'? Rename it"),
        ("pc11/psig", "column 'pc11/psig' is not known; did you mean 'pc11 [psi(g)]'? Rename it"),
        ("p11 [kPa", "column 'p11 [kPa' is not known; did you mean 'p11 [kPa]'? Rename it"),
        ("Q11 ]mm[", "column 'Q11 ]mm['"),
    ],
)
def test_absurd_headings_end_at_once(heading: str, expected: str, tmp_path: Path) -> None:
    if heading.startswith("Q11"):
        assert read(tmp_path, f"t [s],{heading}\n0,1\n").columns == ("t", heading)
    else:
        assert expected in fault(tmp_path, f"t [s],{heading}\n0,1\n")


def test_999_sections_are_read(tmp_path: Path) -> None:
    heads = read(tmp_path, "t [s],x999 [m]\n0,1\n").head_positions
    assert heads is not None
    assert heads.shape == (1, 999, 3)
    assert np.nansum(heads) == 1.0


def test_a_table_of_too_many_columns_is_none(tmp_path: Path) -> None:
    headings = ",".join(f"a{k}" for k in range(20_000))
    assert fault(tmp_path, f"t [s],{headings}\n0\n") == "FILE: has 20001 columns; a log has at most 10000"


def test_a_heading_of_blanks_takes_no_time() -> None:
    # Once this took minutes: each blank was tried with each other one.
    text = "Log.from_arrays({'t [s]': [0], 'p11' + ' ' * 100000 + '[Pa' + ' ' * 100000 + '(x': [0]})"
    code = f"from bha import Log, LogError\ntry:\n    {text}\nexcept LogError:\n    print('refused')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "refused\n"


@pytest.mark.parametrize(
    ("heading", "expected"),
    [
        ("p11 [mPa(g)]", "'mPa' is 0.001 Pa; almost always 'MPa' is meant"),
        ("p11 [Mbar(g)]", "'Mbar' is 1e+11 Pa; almost always 'mbar' is meant"),
        ("q11 [Mm]", "'Mm' is 1e+06 m; almost always 'mm' is meant"),
        ("p11 [GPa]", "'GPa' is 1e+09 Pa; hardly anybody measures an arm in it"),
    ],
)
def test_units_of_an_odd_size_are_warned_of(heading: str, expected: str, tmp_path: Path) -> None:
    with pytest.warns(LogWarning) as caught:
        read(tmp_path, f"t [s],{heading}\n0,1\n")
    assert [str(warning.message) for warning in caught] == [f"{tmp_path / 'log.csv'}: column '{heading}': {expected}"]
    assert caught[0].filename == __file__


def test_usual_units_are_not_odd() -> None:
    for unit, si in [("ns", "s"), ("h", "s"), ("um", "m"), ("km", "m"), ("MPa", "Pa"), ("hPa", "Pa"), ("mN", "N")]:
        assert doubt(unit, si) is None


def test_absolute_pressures_that_start_from_vacuum_are_doubted(tmp_path: Path) -> None:
    text = "t [s],p11 [psi],p12 [psi],p13 [bar(a)]\n0,0,0,0\n1,3,0,2\n"
    with pytest.warns(
        LogWarning, match=r"column 'p11 \[psi\]' \(and 1 more\) reaches 0, that is vacuum, absolute press"
    ):
        read(tmp_path, text)
    with pytest.warns(LogWarning, match=r"is this gauge pressure\? Then write 'pc11 \[kPa\(g\)\]'"):
        Log.from_arrays({"t [s]": [0, 1], "pc11 [kPa]": [0.0, 150.0]})
    # Stated, gauge, never near vacuum, or nothing but vacuum: no doubt.
    for heading, values in [("[bar(a)]", "02"), ("[bar]", "12"), ("[bar(g)]", "02"), ("[bar]", "00")]:
        read(tmp_path, f"t [s],p11 {heading}\n0,{values[0]}\n1,{values[1]}\n")


def test_the_lines_of_an_old_mac(tmp_path: Path) -> None:
    assert len(read(tmp_path, "t [s],p11 [bar]\r0,1\r1,2\r")) == 2
    assert "FILE, line 4, column 'p11 [bar]': found \"x\"" in fault(tmp_path, "t [s],p11 [bar]\r0,1\r\r1,x\r")
    with pytest.warns(LogWarning, match="the last line has no line end"):
        read(tmp_path, "t [s],p11 [bar]\r0,1\r1,2")
