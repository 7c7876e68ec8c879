"""Logs of arrays and tables in memory, and copies of logs: what is no plain real number is refused by name."""

import copy
import pickle
from collections.abc import Iterator
from decimal import Decimal
from typing import Any

import numpy as np
import pytest

import bha
from bha import Log, Recording
from bha.errors import LogError

TIME = {"t [s]": [0.0, 1.0]}
DATES = np.array(["2020-01-01", "2020-01-02"], "datetime64[D]")


def fault(columns: Any, **options: Any) -> str:
    with pytest.raises(LogError) as caught:
        Log.from_arrays(columns, **options)
    return str(caught.value)


@pytest.mark.parametrize("heading", ["p11 [Pa]", "q11 [mm]", "wire [mm]"])
@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.ma.masked_array([1e5, 7e9], mask=[False, True]), "holds masked values; missing=True takes them as missing"),
        (np.array([1e5 + 5j, 2e5]), "holds complex numbers; expected plain real numbers"),
        ([1e5, 2j], "holds complex numbers"),
        (DATES, "holds dates; expected plain real numbers, best float64; give seconds since some moment"),
        (DATES - DATES[0], "holds durations; expected plain real numbers, best float64; divide them by"),
        (["1e5", "2e5"], "holds text"),
        ([b"1e5", b"2e5"], "holds text"),
        (np.array(["1e5", 2e5], dtype=object), "holds text"),
        (np.array([True, False]), "holds true or false"),
        (np.zeros(2, "f8,f8"), "holds records"),
        ([object(), 1.0], "holds object; expected plain real numbers"),
        ([10**400, 1], "holds a number beyond the range of float64"),
        ([[1.0], [1.0, 2.0]], "not an array of numbers"),
        (1e5, "found shape (); expected (2,)"),
        ([1e5, 1e5, 1e5], "found shape (3,); expected (2,)"),
        ([1e5, np.inf], "inf"),
    ],
)
def test_what_is_no_plain_real_number_is_refused_by_name(heading: str, values: Any, expected: str) -> None:
    found = fault(TIME | {heading: values})
    assert f"column '{heading}'" in found
    assert expected in found


def test_plain_real_numbers_of_any_layout() -> None:
    unaligned = np.frombuffer(b"\0" + np.array([1e5, 2e5]).tobytes(), np.uint8)[1:].view(np.float64)
    strided = np.repeat([1e5, 2e5], 3)[::3]
    frozen = np.array([1e5, 2e5])
    frozen.flags.writeable = False
    others = [np.array([1e5, 2e5], ">f8"), np.array([100000, 200000], ">u4"), [Decimal("1e5"), 200000]]
    others += [np.ma.masked_array([1e5, 2e5]), np.array([1e5, 2e5], np.longdouble), range(100000, 300000, 100000)]
    for given in (unaligned, strided, frozen, *others):
        pressure = Log.from_arrays(TIME | {"p11 [Pa]": given})["p11"]
        np.testing.assert_array_equal(pressure, [1e5, 2e5])
        assert pressure.dtype == np.float64
        assert pressure.flags.c_contiguous
        assert pressure.flags.aligned


def test_missing_samples_in_memory() -> None:
    columns = TIME | {"q11 [mm]": np.ma.masked_array([150.0, 7e9], mask=[False, True]), "wire [mm]": [None, 2.0]}
    log = Log.from_arrays(columns, missing=True)
    np.testing.assert_array_equal(log["q11"], [0.15, np.nan])
    np.testing.assert_array_equal(log["wire"], [np.nan, 2.0])
    assert log.missing
    found = fault(TIME | {"p11 [Pa]": np.ma.masked_array([1e5, 7e9], mask=[False, True])}, missing=True)
    assert "<arrays>, row 2, column 'p11 [Pa]': found \"NaN\", no value; write the last known value" in found


def test_what_is_no_table_of_columns_is_refused() -> None:
    for given in ([1, 2], np.zeros((2, 2)), "log.csv", None):
        assert f"<arrays>: found {type(given).__name__}; expected arrays by heading" in fault(given)
    assert fault(TIME | {5: [1.0, 2.0]}) == "<arrays>: found the column name 5; names are texts, such as 'p11 [Pa]'"
    with pytest.raises(LogError, match=r"<table>: found dict; expected a table with columns by name"):
        Log.from_frame(TIME)


@pytest.mark.parametrize(
    ("heading", "value", "unit"),
    [("p11 [bar]", 1e308, "Pa"), ("q11 [m]", -1e31, "m"), ("q11 [mm]", 1e300, "m"), ("t [h]", 1e28, "s")],
)
def test_values_too_great_to_compute_with_are_errors(heading: str, value: float, unit: str) -> None:
    columns = {"t [s]": [0.0, 1.0, 2.0], heading: [1.0, np.nan if heading[0] == "q" else 1.0, value]}
    if heading.startswith("t"):
        del columns["t [s]"]
    found = f"row 3, column '{heading}': the value is too great to compute with, above 1e+30 {unit}; check the unit"
    assert found in fault(columns, missing=True)
    assert len(Log.from_arrays({"t [s]": [0.0], "wire": [1e308]})) == 1


class Column:
    """What a column of a table of another library can do."""

    def __init__(self, values: Any, name: str | None = None) -> None:
        self._values = np.asarray(values)
        self.name = name

    def to_numpy(self) -> np.ndarray:
        return self._values


class NullableColumn(Column):
    """A column with a mark of its own for what is not there."""

    def is_null(self) -> list[bool]:
        return [value == "nothing" for value in self._values.tolist()]


class Table:
    """What a DataFrame can do: columns by name, maybe an index."""

    def __init__(self, columns: dict[Any, Column], index: Column | None = None) -> None:
        self._columns = columns
        if index is not None:
            self.index = index

    @property
    def columns(self) -> Iterator[Any]:
        return iter(self._columns)

    def __getitem__(self, name: Any) -> Column:
        return self._columns[name]


def test_tables_of_other_libraries() -> None:
    columns = {
        "p11 [kPa(g)]": Column([0.0, 1.0]),
        "q11 [mm]": NullableColumn(np.array([150, "nothing"], dtype=object)),
        "note": Column(["start", "end"]),
        "when": Column(DATES),
    }
    table = Table(columns, index=Column([0, 500], "t [ms]"))
    log = Log.from_frame(table, ambient_pressure=1e5, missing=True)
    assert log.columns == ("t", "p11", "q11")
    np.testing.assert_array_equal(log.time, [0.0, 0.5])
    np.testing.assert_array_equal(log["p11"], [1e5, 101e3])
    np.testing.assert_array_equal(log["q11"], [0.15, np.nan])
    assert log.ignored["note"].startswith("holds text")
    assert log.ignored["when"].startswith("holds dates")
    assert Log.from_arrays(table, ambient_pressure=1e5, missing=True) == log
    with pytest.raises(LogError, match=r"<table>, row 2, column 'q11 \[mm\]': found \"NaN\", no value; write"):
        Log.from_frame(table)
    with pytest.raises(LogError, match=r"<table>, column 'q12 \[mm\]': holds text"):
        Log.from_frame(Table(columns | {"q12 [mm]": Column(["1", "2"])}, table.index), missing=True)


@pytest.mark.parametrize("library", ["pandas", "polars", "pyarrow"])
def test_tables_of_the_libraries_themselves(library: str) -> None:
    module = pytest.importorskip(library)
    make = module.table if library == "pyarrow" else module.DataFrame
    log = Log.from_frame(
        make({"t [s]": [0, 1], "p11 [Pa]": [1e5, 2e5], "q11 [m]": [None, 0.25], "note": ["a", "b"]}), missing=True
    )
    assert log.columns == ("t", "p11", "q11")
    np.testing.assert_array_equal(log["q11"], [np.nan, 0.25])
    assert log.ignored["note"].startswith("holds text")


def some_log() -> Log:
    columns = {"t [s]": [0.0, 1.0, 2.0], "p11 [kPa(g)]": [0.0, 1.0, 2.0], "q11 [mm]": [150.0, None, 151.0]}
    return Log.from_arrays(columns, missing=True)


@pytest.mark.parametrize(
    "again", [lambda log: pickle.loads(pickle.dumps(log)), copy.deepcopy, copy.copy], ids=["pickle", "deepcopy", "copy"]
)
@pytest.mark.parametrize("part", [False, True])
def test_copies_are_equal_and_read_only(again: Any, part: bool) -> None:
    log = some_log().between(1.0, 2.0) if part else some_log()
    copied = again(log)
    assert copied == log
    assert hash(copied) == hash(log)
    assert (copied.ambient_pressure, copied.gauge_columns, copied.missing) == (101325.0, ("p11",), True)
    assert dict(copied.headings) == {"t": "t [s]", "p11": "p11 [kPa(g)]", "q11": "q11 [mm]"}
    for name in copied.columns:
        assert not copied[name].flags.writeable
    with pytest.raises(TypeError):
        copied.units["q11"] = "mm"
    assert copied.with_ambient_pressure(9e4)["p11"][0] == 9e4 + (1e3 if part else 0.0)


def test_a_subclass_keeps_what_is_its_own() -> None:
    class Run(Log):
        operator = ""

    run = Run.from_arrays(TIME)
    run.operator = "somebody"
    assert isinstance(run, Run)
    assert copy.deepcopy(run).operator == "somebody"


def test_equality_is_that_of_the_data() -> None:
    log = some_log()
    assert log == some_log()
    assert log != log.between(0.0, 1.0)
    assert log != log.with_ambient_pressure(9e4)
    assert log != Log.from_arrays({"t [s]": [0.0, 1.0, 2.0]})
    assert log != "log"
    assert len({log, some_log(), log.between(0.0, 1.0)}) == 2


def test_a_copied_log_drives_an_arm_as_the_first_one_does() -> None:
    arm = bha.robots.load("bha_nominal")
    columns = {"t [s]": [0.0, 0.1]} | {f"{name} [Pa]": [1.1e5, 1.2e5] for name in arm.inputs}
    log = Log.from_arrays(columns)
    again = pickle.loads(pickle.dumps(log))
    np.testing.assert_array_equal(Recording(arm, again).drive.pressures, Recording(arm, log).drive.pressures)


@pytest.mark.parametrize(("unit", "size"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_epochs_keep_their_steps(unit: str, size: float) -> None:
    start = 1_700_000_000
    steps = np.arange(1000) * 0.001
    whole = np.round((start + steps) * 1000).astype(np.int64)
    given: Any = start + steps if unit == "s" else whole * int(size / 1000)
    time = Log.from_arrays({f"t [{unit}]": given}).time
    # A float64 of an epoch is a multiple of 2^-22 s in seconds, and of 256 ns in nanoseconds.
    np.testing.assert_allclose(time - time[0], steps, atol=5e-7 if unit == "ns" else 2.0**-22, rtol=0)
    assert (np.diff(time) > 0).all()
