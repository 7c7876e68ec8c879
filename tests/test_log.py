"""Measured logs: what is read is what was written, in SI units, and every fault is named with its place."""

import gzip
import hashlib
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bha import _core
from bha.errors import InputError, LogError, LogWarning
from bha.logs import Log

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

ASU = Path(__file__).parents[2] / "shared" / "data" / "asu"

GOOD = """\
note,p12 [kPa(g)],t [ms],q11 [mm],x2 [m],z2 [m],fx1 [N],pc12 [bar],wire [mm],t_amb [degC]
start,0.5,0,150,0.1,0.2,1,1.5,7,20
,-0.5,0,150,0.1,0.2,2,1.5,,21
end,1.5,2500,151,0.1,0.25,3,1.5,9,22
"""


def write(folder: Path, text: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def fault(path: Path, **options: Any) -> str:
    with pytest.raises(LogError) as caught:
        Log.read(path, **options)
    return str(caught.value).replace(f"{path}", "FILE")


def parquet_file(folder: Path, columns: dict[str, Any], **options: Any) -> Path:
    path = folder / "log.parquet"
    parquet.write_table(pyarrow.table(columns), path, **options)
    return path


def assert_good(log: Log) -> None:
    assert len(log) == 3
    np.testing.assert_array_equal(log.time, [0.0, 0.0, 2.5])
    np.testing.assert_allclose(log["p12"], [101825.0, 100825.0, 102825.0], rtol=1e-14)
    np.testing.assert_allclose(log.pressures(["p12"], commanded=True), [[1.5e5]] * 3, rtol=1e-14)
    assert log.lengths is not None
    np.testing.assert_allclose(log.lengths[:, 0], [0.15, 0.15, 0.151], rtol=1e-14)
    assert np.isnan(log.lengths[:, 1:]).all()
    assert log.head_positions is not None
    assert log.head_positions.shape == (3, 2, 3)
    np.testing.assert_array_equal(log.head_positions[:, 1, 2], [0.2, 0.2, 0.25])
    assert np.isnan(log.head_positions[:, 0]).all()
    assert log.forces is not None
    np.testing.assert_array_equal(log.forces, [[[1.0, 0.0, 0.0]], [[2.0, 0.0, 0.0]], [[3.0, 0.0, 0.0]]])
    padded = log.forces_on(3)
    assert padded is not None
    np.testing.assert_array_equal(padded[:, 0], log.forces[:, 0])
    np.testing.assert_array_equal(padded[:, 1:], np.zeros((3, 2, 3)))
    assert log.velocities is None
    np.testing.assert_array_equal(log["wire"], [7.0, np.nan, 9.0])
    assert dict(log.units) == {
        "p12": "Pa",
        "t": "s",
        "q11": "m",
        "x2": "m",
        "z2": "m",
        "fx1": "N",
        "pc12": "Pa",
        "wire": "mm",
        "t_amb": "degC",
    }
    assert log.columns == tuple(log.units)
    assert log.gauge_columns == ("p12",)
    for name in log.columns:
        assert log[name].dtype == np.float64
        assert not log[name].flags.writeable
    assert not log.lengths.flags.writeable


def test_columns_in_any_order_in_si_units(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    log = Log.read(path)
    assert_good(log)
    assert log.ignored == {"note": "line 2: 'start' is not a number"}
    assert log.path == path
    assert log.sha256 == hashlib.sha256(GOOD.encode()).hexdigest()
    assert "3 rows, 0 to 2.5 s" in repr(log)
    with pytest.raises(LogError, match=r"column 'note' was not read: line 2: 'start' is not a number"):
        log["note"]


@pytest.mark.parametrize("name", ["log.csv.gz", "log.csv", "without_extension"])
def test_gzip_is_known_by_its_bytes(name: str, tmp_path: Path) -> None:
    assert_good(Log.read(write(tmp_path, gzip.compress(GOOD.encode()), name)))


@pytest.mark.parametrize("name", ["log.mat", "log.h5", "log.mcap", "log.bag", "log.parquet"])
def test_a_table_of_text_is_one_whatever_its_name_ends_with(name: str, tmp_path: Path) -> None:
    assert_good(Log.read(write(tmp_path, GOOD.encode(), name)))


def test_line_ends_and_byte_order_mark_of_windows(tmp_path: Path) -> None:
    assert_good(Log.read(write(tmp_path, b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())))


def test_parquet_by_its_bytes(tmp_path: Path) -> None:
    lines = [line.split(",") for line in GOOD.splitlines()]
    columns: dict[str, Any] = {"note": ["a", "b", "c"]}
    for place, heading in enumerate(lines[0][1:], start=1):
        cells = [float(line[place]) if line[place] else None for line in lines[1:]]
        columns[heading] = pyarrow.array(cells, pyarrow.float64())
    columns["p12 [kPa(g)]"] = columns["p12 [kPa(g)]"].cast(pyarrow.float32())
    columns["t [ms]"] = columns["t [ms]"].cast(pyarrow.int32())
    path = parquet_file(tmp_path, columns, row_group_size=2)
    calls: list[float] = []
    log = Log.read(path.rename(tmp_path / "log.csv"), progress=calls.append)
    assert_good(log)
    assert log.ignored == {"note": "string is not a type of numbers"}
    assert (calls[0], calls[-1]) == (0.0, 1.0)
    assert calls == sorted(calls)


def test_ambient_pressure_of_gauge_columns(tmp_path: Path) -> None:
    path = write(tmp_path, "t [s],p11 [kPa(g)],p12 [kPa],p13 [bar(a)]\n0,-50,100,2\n")
    log = Log.read(path, ambient_pressure=90e3)
    np.testing.assert_allclose(log.pressures(["p13", "p11", "p12"]), [[2e5, 40e3, 100e3]], rtol=1e-14)
    moved = log.with_ambient_pressure(95e3)
    np.testing.assert_allclose(moved.pressures(["p11", "p12"]), [[45e3, 100e3]], rtol=1e-14)
    assert moved.ambient_pressure == 95e3
    assert log["p11"][0] == 40e3
    assert moved.sha256 == log.sha256
    with pytest.raises(
        LogError, match=r"column 'p11': -10000.0 Pa at an ambient pressure of 40000.0 Pa is below vacuum"
    ):
        log.with_ambient_pressure(40e3)
    with pytest.raises(InputError, match=r"ambient_pressure: found nan; allowed: a finite number >= 0"):
        Log.read(path, ambient_pressure=np.nan)


def test_only_some_columns(tmp_path: Path) -> None:
    text = "q11 [mm],t [s],p11 [Pa]\nx,0,5\nx,1,6\n"
    log = Log.read(write(tmp_path, text), columns=["p11"])
    assert log.columns == ("t", "p11")
    assert "no column 'p12'; nearest: 'p11'" in fault(write(tmp_path, text), columns=["p12"])


FAULTS = [
    ("t [s],p11 [Pa]\n0,1\n1,abc\n", "FILE, line 3, column 'p11 [Pa]': found \"abc\"; expected a number such as -1.5"),
    ("t [s],p11 [Pa]\n0,NaN\n", "FILE, line 2, column 'p11 [Pa]': found \"NaN\", no value; write the last"),
    ("t [s],p11 [Pa]\n0,inf\n", "FILE, line 2, column 'p11 [Pa]': found \"inf\"; expected a finite number"),
    ("t [s],p11 [Pa]\n0,\n", "FILE, line 2, column 'p11 [Pa]': the cell is empty; write the last known value"),
    (
        "t [s],p11 [Pa]\n0,1\n\n2,1\n1,1\n",
        "FILE, line 5, column 't [s]': time runs backwards, from 2.0 to 1.0; times may",
    ),
    (
        "t [s],p11 [kPa]\n0,-0.5\n",
        "least possible value 0.0; that of vacuum; is this gauge pressure? Then write 'p11 [kPa(g)]'",
    ),
    (
        "t [s],p11 [kPa(g)]\n0,-102\n",
        "found -102.0, below the least possible value -101.325; that of vacuum at an ambient",
    ),
    ("t [s],p11 [Pa]\n0,1,2\n", "FILE, line 2: found 3 fields; the headings have 2: mend the line or remove it"),
    (
        "t [s],p11 [Pa]\n0,1\n1",
        "FILE, line 3: found 1 field; the headings have 2: mend the line or remove it; the file ends inside this line",
    ),
    ("t [s],p11 [Pa]\n", "FILE has headings but no rows of numbers"),
    ("", "FILE: the file is empty; expected a line of headings and lines of numbers"),
    ("t [s];p11 [Pa]\n0;1,2.3\n", "FILE, line 1: the headings are separated by ';'; expected commas"),
    (
        "t [s],p11 [Pa]\n\0\0\0",
        "FILE is not a text file but binary data; expected CSV, plain or gzip: is it the right file?",
    ),
    (
        "time [s],p11 [Pa]\n0,1\n",
        "FILE: there is no column of time, 't [s]'; column 'time [s]' is not known; did you mean",
    ),
    ("t(s),p11 [Pa]\n0,1\n", "FILE: column 't(s)' is not known; did you mean 't [s]'? Rename it"),
    ("t [s],p 11 [Pa]\n0,1\n", "FILE: column 'p 11 [Pa]' is not known; did you mean 'p11 [Pa]'? Rename it"),
    ("t [s],P11 [kPa(g)]\n0,1\n", "FILE: column 'P11 [kPa(g)]' is not known; did you mean 'p11 [kPa(g)]'? Rename it"),
    ("t [s],p1_1 [Pa]\n0,1\n", "FILE: column 'p1_1 [Pa]' is not known; did you mean 'p11 [Pa]'? Rename it"),
    ("t [s],Q-11\n0,1\n", "FILE: column 'Q-11' is not known; did you mean 'q11 [m]'? Rename it"),
    ("t [s],p11\n0,1\n", "FILE: column 'p11' has no unit; write it as 'p11 [Pa]'"),
    ("t [s],p11 []\n0,1\n", "FILE: column 'p11 []' has no unit; write it as 'p11 [Pa]'"),
    (
        "t [s],p11 [mm]\n0,1\n",
        "FILE: column 'p11 [mm]': unit 'mm' does not fit; expected a pressure, such as Pa, kPa, bar",
    ),
    ("t [s],q11 [mm(g)]\n0,1\n", "FILE: column 'q11 [mm(g)]': unit 'mm(g)' does not fit; expected a length"),
    ("t [s],x1 [m/s]\n0,1\n", "FILE: column 'x1 [m/s]': unit 'm/s' does not fit; expected a length, such as m or mm"),
    (
        "t [s],p11 [Pa],p11 [kPa]\n0,1,1\n",
        "FILE: column 'p11' stands twice, 'p11 [Pa]' and 'p11 [kPa]'; remove or rename",
    ),
    ("t [s],a,a\n0,1,1\n", "FILE: column 'a' stands twice, 'a' and 'a'; remove or rename one of them"),
    ('t [s],p11 [Pa]\n0,"1\n', "column 'p11 [Pa]': found \"1\\n\"; expected a number such as -1.5 or 2.5e3"),
]


@pytest.mark.parametrize(("text", "expected"), FAULTS)
def test_faults_are_named(text: str, expected: str, tmp_path: Path) -> None:
    assert expected in fault(write(tmp_path, text))


def test_faults_of_files(tmp_path: Path) -> None:
    assert fault(tmp_path / "missing.csv") == "FILE: there is no such file"
    assert fault(tmp_path) == "FILE is a folder; name a file in it"
    packed = gzip.compress(GOOD.encode())
    assert fault(write(tmp_path, packed[:-20])) == "FILE: the gzip data ends too early: the file was cut off"
    assert "the gzip data is damaged" in fault(write(tmp_path, packed[:40] + b"\xff" * 9 + packed[49:]))
    assert "a zip archive or a spreadsheet (.xlsx)" in fault(write(tmp_path, b"PK\x03\x04"))
    assert "is a parameter file by its name, and no log" in fault(write(tmp_path, GOOD, "arm.toml"))


def test_columns_that_only_look_like_quantities_are_kept(tmp_path: Path) -> None:
    log = Log.read(write(tmp_path, "t [s],T [K],Q11 [l/min],,qv14 [mm]\n0,290,3,9,1\n"))
    assert log.columns == ("t", "T", "Q11", "qv14")
    assert log.lengths is None
    assert log.ignored == {"column 4": "it has no heading"}


def test_a_last_line_without_end_is_warned_of(tmp_path: Path) -> None:
    with pytest.warns(LogWarning, match=r"the last line has no line end; if the file was cut off"):
        assert len(Log.read(write(tmp_path, "t [s]\n0\n1"))) == 2


PARQUET_FAULTS = [
    (
        {"t [s]": [0.0, 1.0], "p11 [Pa]": [1.0, np.nan]},
        "FILE, row 2, column 'p11 [Pa]': found \"NaN\", no value; write the last known value",
    ),
    (
        {"t [s]": [0.0, 1.0], "p11 [Pa]": [1.0, None]},
        "FILE, row 2, column 'p11 [Pa]': the cell is empty; write the last",
    ),
    ({"t [s]": [0.0, 1.0, 0.5]}, "FILE, row 3, column 't [s]': time runs backwards, from 1.0 to 0.5; times may repeat"),
    (
        {"t [s]": [0.0], "p11 [Pa]": [-1.0]},
        "FILE, row 1, column 'p11 [Pa]': found -1.0, below the least possible value 0.0",
    ),
    ({"t [s]": [0.0], "p11 [Pa]": ["1"]}, "FILE, column 'p11 [Pa]': holds string; expected numbers, best float64"),
    ({"t [s]": [0.0], "p 11 [Pa]": [1.0]}, "FILE: column 'p 11 [Pa]' is not known; did you mean 'p11 [Pa]'?"),
    ({"t [s]": np.zeros(0)}, "FILE has headings but no rows of numbers"),
]


@pytest.mark.parametrize(("columns", "expected"), PARQUET_FAULTS)
def test_faults_in_parquet_are_named(columns: dict[str, Any], expected: str, tmp_path: Path) -> None:
    assert expected in fault(parquet_file(tmp_path, columns))


def test_cut_parquet(tmp_path: Path) -> None:
    path = parquet_file(tmp_path, {"t [s]": [0.0, 1.0]})
    path.write_bytes(path.read_bytes()[:-30])
    assert "FILE: the Parquet data is damaged or cut off: " in fault(path)


def test_arrays_get_the_same_checks() -> None:
    log = Log.from_arrays({"t [s]": [0, 1], "p11 [bar(g)]": np.array([0, 1], dtype=np.float32)})
    np.testing.assert_allclose(log["p11"], [101325.0, 201325.0])
    assert (log.path, log.sha256) == (None, None)
    for columns, expected in [
        ({"t [s]": [0, 1], "p11 [Pa]": [1, np.nan]}, "<arrays>, row 2, column 'p11 [Pa]': found \"NaN\""),
        ({"t [s]": [0, 1], "p11 [Pa]": [1]}, "<arrays>, column 'p11 [Pa]': found shape (1,); expected (2,)"),
        ({"t [s]": [[0, 1]]}, "<arrays>, column 't [s]': found shape (1, 2); expected (m,)"),
        ({"t [s]": ["a"]}, "<arrays>, column 't [s]': holds text; expected plain real numbers"),
        ({"t [s]": []}, "<arrays> has headings but no rows of numbers"),
        ({}, "<arrays>: there is no column of time"),
    ]:
        with pytest.raises(LogError) as caught:
            Log.from_arrays(columns)
        assert expected in str(caught.value)


def test_given_arrays_are_not_changed() -> None:
    time, pressure = np.array([0.0, 1.0]), np.array([1.0, 2.0])
    Log.from_arrays({"t [ms]": time, "p11 [kPa]": pressure})
    np.testing.assert_array_equal([time, pressure], [[0.0, 1.0], [1.0, 2.0]])
    time[0] = 0.5


def test_forces_beyond_the_arm_are_an_error() -> None:
    log = Log.from_arrays({"t [s]": [0.0], "fz3 [N]": [1.0]})
    with pytest.raises(LogError, match=r"<arrays>: has a force on section 3; the arm has 2 sections"):
        log.forces_on(2)


def test_missing_pressures_name_the_nearest() -> None:
    log = Log.from_arrays({"t [s]": [0.0], "p11 [Pa]": [1.0], "pc23 [Pa]": [1.0]})
    with pytest.raises(LogError, match=r"<arrays>: there is no column 'p12'; nearest: 'p11'"):
        log.pressures(["p11", "p12"])
    with pytest.raises(LogError, match=r"there is no column 'pc22'; nearest: 'pc23'"):
        log.pressures(["p22"], commanded=True)


def test_between_takes_both_ends_and_repeated_times() -> None:
    log = Log.from_arrays({"t [s]": [0, 1, 1, 2, 3], "a": [0, 1, 2, 3, 4]})
    part = log.between(1.0, 2.0)
    np.testing.assert_array_equal(part["a"], [1, 2, 3])
    assert part["a"].base is not None
    assert not part["a"].flags.writeable
    assert len(log.between(-5, 9)) == 5
    with pytest.raises(InputError, match=r"no row between 1.2 and 1.8 s; the log has 0.0 to 3.0 s"):
        log.between(1.2, 1.8)
    with pytest.raises(InputError, match="no row between nan"):
        log.between(np.nan, np.nan)


PRESSURE_UNITS = {"Pa": 1.0, "kPa": 1e3, "bar": 1e5, "mbar": 100.0, "psi": 6894.757293168361}
LENGTH_UNITS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "inch": 0.0254}


@st.composite
def tables(draw: st.DrawFn) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """The columns of a file by heading, and what is to be read by name."""
    rows = draw(st.integers(1, 5))
    number = st.floats(-1e6, 1e6)
    times = sorted(draw(st.lists(number, min_size=rows, max_size=rows)))
    found, expected = {"t [s]": times}, {"t": times}
    for name in draw(st.sets(st.sampled_from(["p11", "p99", "p10_1", "pc23", "pc1_12"]))):
        unit, gauge = draw(st.sampled_from(sorted(PRESSURE_UNITS))), draw(st.booleans())
        values = draw(st.lists(st.floats(0, 1e6), min_size=rows, max_size=rows))
        found[f"{name} [{unit}{'(g)' if gauge else ''}]"] = values
        expected[name] = [v * PRESSURE_UNITS[unit] + 101325.0 * gauge for v in values]
    for name in draw(st.sets(st.sampled_from(["q11", "q23", "q10_3", "x1", "y12", "z2"]))):
        unit = draw(st.sampled_from(sorted(LENGTH_UNITS)))
        found[f"{name} [{unit}]"] = draw(st.lists(number, min_size=rows, max_size=rows))
        expected[name] = [v * LENGTH_UNITS[unit] for v in found[f"{name} [{unit}]"]]
    for name in draw(st.sets(st.sampled_from(["wire", "flow [l/min]", 'odd, "name" [%]', "q1_13"]))):
        values = draw(st.lists(st.floats(allow_infinity=False), min_size=rows, max_size=rows))
        found[name] = expected[name.partition(" [")[0]] = values
    order = draw(st.permutations(sorted(found)))
    return {heading: found[heading] for heading in order}, expected


@pytest.mark.filterwarnings("ignore:.*that is vacuum, absolute")
@given(tables(), st.sampled_from([".csv", ".csv.gz", ".parquet"]))
def test_random_tables_in_any_order_and_units(
    tmp_path_factory: pytest.TempPathFactory,
    table: tuple[dict[str, list[float]], dict[str, list[float]]],
    extension: str,
) -> None:
    columns, expected = table
    folder = tmp_path_factory.mktemp("log")
    lines = ['"' + '","'.join(heading.replace('"', '""') for heading in columns) + '"']
    lines += [",".join("" if np.isnan(v) else repr(v) for v in row) for row in zip(*columns.values(), strict=True)]
    log = Log.read(write(folder, "\n".join([*lines, ""])))
    assert set(log.columns) == set(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(log[name], values, rtol=1e-12, atol=0)
    path = folder / f"again{extension}"
    log.write(path)
    again = Log.read(path)
    assert again.columns == log.columns
    assert dict(again.units) == dict(log.units)
    for name in log.columns:
        assert again[name].tobytes() == log[name].tobytes() or np.isnan(log[name]).any()
        np.testing.assert_array_equal(again[name], log[name])


def test_writing_is_whole_or_not_at_all(tmp_path: Path) -> None:
    log = Log.from_arrays({"t [s]": np.arange(3.0)})
    with pytest.raises(InputError, match=r"unknown extension .txt; logs are written as .parquet, .csv or .csv.gz"):
        log.write(tmp_path / "log.txt")
    with pytest.raises(InputError, match=r"the folder .* does not exist"):
        log.write(tmp_path / "nowhere" / "log.csv")

    def stop(fraction: float) -> None:
        raise InterruptedError(f"at {fraction}")

    for name in ("log.csv", "log.csv.gz", "log.parquet"):
        with pytest.raises(InterruptedError, match=r"at 0.0"):
            log.write(tmp_path / name, progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_progress_is_told_and_its_errors_come_back_as_they_are(tmp_path: Path) -> None:
    path = write(tmp_path, "t [s]\n0\n")
    calls: list[float] = []
    Log.read(path, progress=calls.append)
    assert calls[-1] == 1.0
    error = RuntimeError("mine")

    def fail(fraction: float) -> None:
        raise error

    with pytest.raises(RuntimeError) as caught:
        Log.read(path, progress=fail)
    assert caught.value is error


def test_reading_answers_an_interrupt(tmp_path: Path) -> None:
    path = write(tmp_path, "t [s]\n" + "0\n" * 10)

    def interrupt(headings: list[str], opening: list[str]) -> list[_core.TableColumn]:
        # Delivered to this process while the core is about to read; nothing but its own check can see it in time.
        signal.raise_signal(signal.SIGINT)
        return [_core.TableColumn("number", -np.inf, "", False, "")]

    with pytest.raises(KeyboardInterrupt):
        _core.read_table(os.fspath(path), interrupt, None)


def test_the_core_checks_what_it_is_given(tmp_path: Path) -> None:
    path = os.fspath(write(tmp_path, "t [s]\n0\n"))
    with pytest.raises(ValueError, match="one entry for each heading"):
        _core.read_table(path, lambda headings, opening: [], None)
    with pytest.raises(ValueError, match="unknown use of a column"):
        _core.read_table(path, lambda headings, opening: [_core.TableColumn("x", 0.0, "", False, "")], None)
    with pytest.raises(ValueError, match="differ in length"):
        _core.format_table_rows([np.zeros(1), np.zeros(2)])


@pytest.mark.skipif(not ASU.is_dir(), reason="needs the measured logs")
@pytest.mark.parametrize("path", sorted(ASU.glob("*.csv")), ids=lambda path: path.stem)
def test_measured_logs(path: Path) -> None:
    log = Log.read(path)
    assert len(log) > 900
    assert len(log.columns) == 23
    assert not log.ignored
    inputs = [f"p{section}{number}" for section in (1, 2) for number in (1, 2, 3)]
    for commanded in (False, True):
        pressures = log.pressures(inputs, commanded=commanded)
        assert pressures.min() > 95e3
        assert pressures.max() < 250e3
    raw = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_allclose(log.pressures(inputs, commanded=True), raw[:, 1:7] * 1e3 + 101325.0, rtol=1e-14)
    assert log.head_positions is not None
    np.testing.assert_array_equal(log.head_positions.reshape(-1, 6), raw[:, 13:19])
    np.testing.assert_array_equal(log["wire1l"], raw[:, 19])
    assert log.units["wire1l"] == "mm"
