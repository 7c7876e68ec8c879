"""Files, tables and mappings with faults of every kind: an error of the package, or something finite; never more.

The examples are fixed. ``HYPOTHESIS_PROFILE=long pytest tests/test_mutations.py`` draws new ones by the thousand, and
gives the processor two seconds for each.
"""

from __future__ import annotations

import copy
import gzip
import io
import json
import os
import pickle
import time
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bha import Arm, Log
from bha.errors import InputError, LogError, ParameterError
from bha.parameters import ArmParameters, paths

LONG = os.environ.get("HYPOTHESIS_PROFILE") == "long"
examples = settings(
    max_examples=20_000 if LONG else 60,
    derandomize=not LONG,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
pytestmark = pytest.mark.filterwarnings("ignore::bha.LogWarning", "ignore::bha.ParameterWarning")

CSV = b"""\
t [s],p11 [kPa(g)],pc11 [bar],q11 [mm],x1 [m],fx1 [N],qd11 [m/s],wire [mm],note
0,0.5,1.5,150,0.1,1,0.0,7,start
0.5,-0.5,1.5,150,0.1,2,1e-3,,
1,1.5,1.25,151,0.1,3,-2.5E-3,9,end
"""
ARM = """\
schema = "bha-arm/1"
name = "one"
gravity = [0.0, 0.0, 9.81]
ambient_pressure = 101325.0

[[section]]
mass = 0.5
bellows_radius = 0.1
bellows_outer_radius = 0.03
terminal_area = 0.0026
rest_length = 0.15
stiffness = [1300.0, 1500.0]
damping = 18.0
bending_stiffness = [4.0, 0.1]
length_range = [0.10, 0.30]
pressure_range = [0.7e5, 2.2e5]

[section.provenance]
mass = { status = "identified", ci95 = [0.4, 0.6], standard_error = 0.05 }
stiffness = "published"

[[section.bellows]]
angle_deg = 0.0

[[section.bellows]]
angle = 2.0
input = "p12"

[[section.bellows]]
angle_deg = 240.0
stiffness = [1.0, 2.0]

[[effect]]
kind = "creep"
where = "section 1"
stiffness = 120.0
tau = 1.5

[[effect]]
kind = "formula"
where = "all"
force = "-c * tanh(qd / v0)"
c = 1.0
v0 = 0.01

[effect.provenance]
c = "assumed"
"""
WORDS = [
    *("", " ", "\n", "\r", "\r\n", ",", ";", "\t", '"', "'", "#", "[", "]", "[[", "]]", "(", ")", "{", "}", "=", "."),
    *(
        "nan",
        "inf",
        "-inf",
        "NA",
        "-",
        "1e999",
        "1e308",
        "-1e308",
        "1e-320",
        "-0.0",
        "0",
        "7",
        "-1",
        "true",
        "1_0",
        "0x1F",
    ),
    *(
        "9" * 400,
        "9" * 5000,
        " " * 3000,
        "\0",
        "\ufeff",
        "²",
        "١",
        "é",
        "\ud7ff",
        "𝔸",
        "1979-05-27",
        "[g]",
        "(g)",
        "(a)",
    ),
    *("t [s]", "t [ns]", "p11 [mPa]", "x99999999 [m]", "q1_999 [m]", "p999_999 [Pa]", "sep=,", "Time (s)", "[section]"),
    *(
        "schema",
        "mass",
        "effect",
        "section",
        "provenance",
        "kind",
        "where",
        "bellows 11",
        "input p11",
        "sensors",
        "a.b",
    ),
]
places = st.floats(0, 1)
words = st.sampled_from(WORDS)
#: A change: where, how much is cut out there, what is put in its place (None: what stood there, twice).
changes = st.lists(st.tuples(places, st.integers(0, 12), st.none() | words), min_size=1, max_size=5)


def changed(content: bytes, made: list[tuple[float, int, str | None]]) -> bytes:
    for place, cut, word in made:
        start = int(place * len(content))
        old = content[start : start + cut]
        new = old + old if word is None else word.encode()
        content = content[:start] + new + content[start + cut :]
    return content


def assert_sound(log: Log) -> None:
    """A log has finite numbers in SI units, but for what may be missing; what is made of it has sane shapes."""
    assert len(log) > 0
    assert np.isfinite(log.time).all()
    assert (np.diff(log.time) >= 0).all()
    for name in log.columns:
        assert log[name].dtype == np.float64
        assert log[name].shape == log.time.shape
        assert not np.isinf(log[name]).any()
        if name.startswith(("p", "fx")):
            assert np.isfinite(log[name]).all()
        if name.startswith("p") and log.units[name] == "Pa":
            assert (log[name] >= 0).all()
        if not log.missing and name in ("q11", "qd11", "x1"):
            assert np.isfinite(log[name]).all()
    for table in (log.lengths, log.velocities, log.head_positions, log.forces):
        assert table is None or table.nbytes < 1e8
    assert pickle.loads(pickle.dumps(log)) == log
    assert "\n" not in repr(log).replace("\\n", "") or any("\n" in name for name in log.columns)


def outcome(call: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """What a call returns, or the package's own error that it raises: of a length that can be read."""
    start = time.process_time()
    try:
        return call(*arguments, **options)
    except (LogError, ParameterError, InputError) as error:
        return error
    finally:
        assert not LONG or time.process_time() - start < 2.0


def assert_readable(error: Exception, origin: str = "") -> None:
    assert origin in str(error)
    assert 10 < len(str(error)) < 8000


def read(path: Path, content: bytes, missing: bool) -> None:
    path.write_bytes(content)
    log = outcome(Log.read, path, missing=missing)
    if isinstance(log, LogError):
        assert_readable(log, str(path))
    else:
        assert_sound(log)


@examples
@given(made=changes, missing=st.booleans())
def test_csv(tmp_path_factory: pytest.TempPathFactory, made: Any, missing: bool) -> None:
    read(tmp_path_factory.getbasetemp() / "log.csv", changed(CSV, made), missing)


@examples
@given(
    rows=st.lists(st.lists(words | st.floats().map(repr), max_size=9), max_size=5), separator=st.sampled_from(",,,;\t")
)
def test_csv_of_words(tmp_path_factory: pytest.TempPathFactory, rows: list[list[str]], separator: str) -> None:
    lines = [CSV.split(b"\n")[0].decode(), *(separator.join(row) for row in rows)]
    read(tmp_path_factory.getbasetemp() / "log.csv", "\n".join(lines).encode(), missing=True)


@examples
@given(
    headings=st.lists(
        st.lists(words | st.sampled_from(["q11", "p11", "x1", "Pa", "mm"]), max_size=4).map("".join), max_size=6
    )
)
def test_headings_of_words(headings: list[str]) -> None:
    log = outcome(Log.from_arrays, {"t [s]": [0.0, 1.0], **{heading: [1e5, 2e5] for heading in headings}})
    if isinstance(log, LogError):
        assert_readable(log)
    else:
        assert_sound(log)


@examples
@given(made=changes)
def test_gzip(tmp_path_factory: pytest.TempPathFactory, made: Any) -> None:
    read(tmp_path_factory.getbasetemp() / "log.csv.gz", changed(gzip.compress(CSV, mtime=0), made), missing=True)


@examples
@given(made=changes, compression=st.sampled_from(["none", "zstd"]), seed=st.integers(0, 2**32))
def test_parquet(tmp_path_factory: pytest.TempPathFactory, made: Any, compression: str, seed: int) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    columns = {"t [s]": np.arange(9.0), "p11 [kPa(g)]": np.zeros(9), "wire": [None, *range(8)], "note": ["a"] * 9}
    file = io.BytesIO()
    parquet.write_table(pyarrow.table(columns), file, compression=compression)
    content = bytearray(changed(file.getvalue(), made) if seed % 2 else file.getvalue())
    # Single bytes: the metadata at the end has most of what can go wrong.
    rng = np.random.default_rng(seed)
    for place in rng.integers(4, len(content), rng.integers(0, 4)):
        content[place] = rng.integers(0, 256)
    read(tmp_path_factory.getbasetemp() / "log.parquet", b"PAR1" + bytes(content[4:]), missing=True)


ARRAYS: list[Any] = [
    *(
        [0.0, 1.0],
        [1, 2],
        [1, None],
        ["1", "2"],
        [b"1", b"2"],
        [1j, 2],
        [True, False],
        [10**400, 1],
        [10**30, 1],
        [[1], [2]],
    ),
    *(
        [[1], [2, 3]],
        [1.0],
        [],
        5,
        None,
        "ab",
        {},
        [np.nan, 1],
        [np.inf, 1],
        [-1e308, 1e308],
        [Decimal("1.5"), Decimal("nan")],
    ),
    *(
        np.ma.masked_array([1.0, 2.0], [0, 1]),
        np.ma.masked_array([1.0, 2.0]),
        np.array([1, 2], ">i2"),
        np.zeros((2, 2)),
    ),
    *(np.array(["2020", "2021"], "datetime64[Y]"), np.array([1, 2], "timedelta64[s]"), np.array([1, 2], object)),
    *(
        np.array([1.5, 2.5], np.longdouble) * np.longdouble("1e4000"),
        np.zeros(2, "f4,f4"),
        np.arange(8.0)[::4],
        range(2),
    ),
    *(
        np.frombuffer(b"\0" * 17, np.uint8)[1:].view(np.float64),
        np.array([object(), object()]),
        np.array(2.0),
        [float, int],
    ),
]
HEADINGS = [
    "t [s]",
    "t [h]",
    "p11 [bar]",
    "p11 [Pa(g)]",
    "q11 [mm]",
    "x1 [m]",
    "fx1 [N]",
    "wire",
    "p12",
    5,
    None,
    "",
    "q99_1 [m]",
]


@examples
@given(columns=st.dictionaries(st.sampled_from(HEADINGS), st.sampled_from(range(len(ARRAYS)))), missing=st.booleans())
def test_arrays(columns: dict[Any, int], missing: bool) -> None:
    given_columns = {heading: ARRAYS[k] for heading, k in ({"t [s]": 0} | columns).items()}
    log = outcome(Log.from_arrays, given_columns, missing=missing)
    if isinstance(log, LogError):
        assert_readable(log)
    else:
        assert_sound(log)


def assert_sound_arm(parameters: ArmParameters) -> None:
    json.loads(parameters.to_core_json(), parse_constant=pytest.fail)
    assert ArmParameters.from_toml(parameters.to_toml()) == parameters
    assert hash(copy.deepcopy(parameters)) == hash(parameters)
    for path in paths.available(parameters)[:200]:
        assert np.isfinite(paths.get_value(parameters, path))
    arm = outcome(Arm.from_parameters, parameters)
    assert isinstance(arm, ParameterError) or len(arm.inputs) > 0


@examples
@given(made=changes)
def test_parameter_files(tmp_path_factory: pytest.TempPathFactory, made: Any) -> None:
    path = tmp_path_factory.getbasetemp() / "arm.toml"
    path.write_bytes(changed(ARM.encode(), made))
    parameters = outcome(ArmParameters.read, path)
    if isinstance(parameters, ParameterError):
        assert_readable(parameters, str(path))
    else:
        assert_sound_arm(parameters)


VALUES: list[Any] = [
    *(
        None,
        True,
        0,
        -1,
        7,
        1e308,
        -1e308,
        1e-320,
        1e200,
        np.nan,
        np.inf,
        10**400,
        10**5000,
        -(10**400),
        1j,
        Decimal(1),
        b"x",
    ),
    *(
        "",
        "²",
        "x" * 5000,
        "p11",
        "section 9",
        "section " + "9" * 5000,
        "bellows 1_99999",
        "a.b",
        "\0",
        "identified",
        [],
        {},
    ),
    *(
        [1.0],
        [1.0, 2.0],
        [0.1, 1e308],
        [[1.0, 2.0]],
        [{}],
        {5: 1},
        {"x": 1},
        {None: {}},
        object(),
        np.zeros(3),
        np.float32(1),
    ),
    *(
        {"status": "identified"},
        {"mass": {"status": "identified", "ci95": [1, 0]}},
        {"²": "assumed"},
        (),
        {1, 2},
        range(3),
    ),
]


def altered(mapping: dict[str, Any], steps: list[int], key: Any, value: Any) -> None:
    """Follow ``steps`` into the tables and lists of ``mapping``; set ``key``, or what stands there, to ``value``."""
    at: Any = mapping
    for step in steps:
        entries = list(at) if isinstance(at, dict) else range(len(at))
        inner = [k for k in entries if isinstance(at[k], dict | list) and len(at[k])]
        if not inner:
            break
        at = at[inner[step % len(inner)]]
    entries = list(at) if isinstance(at, dict) else range(len(at))
    at[key if isinstance(at, dict) and key is not ... else entries[(steps or [0])[-1] % len(entries)]] = value


@examples
@given(
    made=st.lists(
        st.tuples(
            st.lists(st.integers(0, 30), max_size=4),
            st.just(...)
            | st.sampled_from([5, None, "²", "mass", "a.b", "effect", "provenance", "bellows", "tau", ("x",)]),
            st.sampled_from(range(len(VALUES))),
        ),
        min_size=1,
        max_size=3,
    )
)
def test_mappings(made: list[tuple[list[int], Any, int]]) -> None:
    mapping = ArmParameters.from_toml(ARM).to_mapping()
    for steps, key, number in made:
        altered(mapping, steps, key, copy.copy(VALUES[number]))
    parameters = outcome(ArmParameters.from_mapping, mapping)
    if isinstance(parameters, ParameterError):
        assert_readable(parameters)
    else:
        assert_sound_arm(parameters)


@examples
@given(
    path=st.lists(words | st.sampled_from(["section", "1", "2", "*", "mass", "effect", "tau"]), max_size=5).map(
        ".".join
    )
)
def test_paths(path: str) -> None:
    parameters = ArmParameters.from_toml(ARM)
    for call in (paths.get_value, paths.expand, lambda p, name: paths.with_values(p, {name: 1.0})):
        outcome(call, parameters, path)
