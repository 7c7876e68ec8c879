"""MATLAB and HDF5 files as logs, written by SciPy and h5py, and by h5py as MATLAB writes version 7.3."""

from __future__ import annotations

import contextlib
import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from click.testing import CliRunner, Result
from numpy.typing import NDArray

import bha
from bha.cli import main
from bha.errors import LogError, MissingExtraError

N = 200
T = np.arange(N) * 0.01
P = np.column_stack([T, 2 * T, 3 * T])
X = np.column_stack([0.1 + T, 0.2 - T, 0.3 + 0 * T])
WXYZ = np.tile([0.8, 0.0, 0.0, 0.6], (N, 1))
SLOW = np.arange(N // 4) * 0.04


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def mapped(columns: dict[str, Any], **time: Any) -> dict[str, Any]:
    return {"schema": "bha-columns/1", "columns": columns, **({"time": time} if time else {})}


def records(**fields: list[Any]) -> NDArray[Any]:
    """A struct array of MATLAB."""
    count = len(next(iter(fields.values())))
    made = np.zeros((1, count), dtype=[(name, "O") for name in fields])
    for name, values in fields.items():
        for k, value in enumerate(values):
            made[name][0, k] = value
    return made


@pytest.fixture(scope="module")
def mat(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Arrays beside a time, Simulink's structure with time, a recording of dSPACE, cells."""
    path = tmp_path_factory.mktemp("mat") / "run.mat"
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = P, "a text"
    signals = records(
        # Simulink stores a signal of several numbers a sample with the samples last.
        values=[P, X.T.reshape(3, 1, N)],
        label=["pressures", "tip"],
        dimensions=[3.0, np.array([3.0, 1.0])],
    )
    slow = records(values=[SLOW[:, None]], label=["length"])
    dspace = {
        "X": records(Name=["time"], Data=[T[None]]),
        "Y": records(Name=["p11", "Model Root/q11"], Data=[P[:, 0][None], 1e3 * X[:, 0][None]], Unit=["bar", "mm"]),
    }
    scipy.io.savemat(
        path,
        {
            "tout": T[:, None],
            "pressures": P,
            "tip": X,
            "quat": WXYZ[:, [1, 2, 3, 0]],
            "logsout": {"time": T[:, None], "signals": signals, "blockName": "arm/log"},
            "slow": {"time": SLOW[:, None], "signals": slow},
            "rec": dspace,
            "cells": cell,
            "title": "first run",
            "gain": 3.0,
            "times_gap": np.where(T == 0.5, np.nan, T),
            "times_back": np.roll(T, 1),
        },
        do_compression=True,
    )
    return path


@pytest.fixture(scope="module")
def hdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hdf") / "run.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("run 1")
        group["t"] = T
        group.create_dataset("pressures", data=P, compression="gzip").attrs["units"] = "bar"
        group["tip"] = X.T
        file["slow/time"] = 1e3 * SLOW
        file["slow/q11"] = 0.1 + SLOW
        table = np.zeros(N, dtype=[("time", "f8"), ("flow", "f4"), ("note", "S4")])
        table["time"], table["flow"] = T, 2 * T
        file["table"] = table
        file["title"] = "a text"
        file["loose"] = np.arange(7.0)
        file["broken"] = h5py.SoftLink("/nowhere")
    return path


@pytest.fixture(scope="module")
def mat73(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As ``save -v7.3`` does: text before the HDF5, axes reversed, structs as groups, cells as references."""
    path = tmp_path_factory.mktemp("mat73") / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:

        def put(group: Any, name: str, values: Any, kind: str = "double") -> Any:
            made = group.create_dataset(name, data=np.asarray(values).T)
            made.attrs["MATLAB_class"] = np.bytes_(kind)
            return made

        def text(group: Any, name: str, value: str) -> Any:
            return put(group, name, np.array([[ord(letter) for letter in value]], dtype="u2"), "char")

        put(file, "tout", T[:, None])
        put(file, "pressures", P)
        kept = file.create_group("#refs#")
        logs = file.create_group("logsout")
        logs.attrs["MATLAB_class"] = np.bytes_("struct")
        put(logs, "time", T[:, None])
        signals = logs.create_group("signals")
        signals.attrs["MATLAB_class"] = np.bytes_("struct")
        fields = {
            "values": [put(kept, "a", P), put(kept, "b", X)],
            "label": [text(kept, "c", "pressures"), text(kept, "d", "tip")],
        }
        for name, items in fields.items():
            signals.create_dataset(name, data=np.array([[i.ref] for i in items], dtype=h5py.ref_dtype))
        made = file.create_dataset("ts", data=np.zeros((1, 6), "u4"))
        made.attrs["MATLAB_class"] = np.bytes_("timeseries")
        empty = file.create_dataset("nothing", data=np.zeros(2, "u8"))
        empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), 1
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


CHANNELS = {"channels": ["p11", "p12", "p13"], "unit": "bar(g)"}


def check_run(log: bha.Log) -> None:
    np.testing.assert_allclose(log.time, T)
    for k in range(3):
        np.testing.assert_allclose(log[f"p1{k + 1}"], 101_325.0 + 1e5 * P[:, k])
        np.testing.assert_allclose(log["xyz"[k] + "1"], X[:, k])
    assert not log.missing


def test_arrays_beside_a_time(mat: Path) -> None:
    columns = {
        "tout": "t [s]",
        "pressures": CHANNELS,
        "tip": {"head": 1},
        "quat": {"head": 2, "quaternion": "xyzw"},
    }
    log = bha.Log.read(mat, mapping=mapped(columns))
    check_run(log)
    assert (log["ow2"][0], log["oz2"][0]) == (0.8, 0.6)
    one = bha.Log.read(mat, mapping=mapped({"tout": "t [ms]", "cells[0][2]": "p13 [bar(g)]"}))
    np.testing.assert_allclose(one["p13"], 101_325.0 + 1e5 * P[:, 2])
    np.testing.assert_allclose(one.time, 1e-3 * T)


def test_structure_with_time_of_simulink(mat: Path, mat73: Path) -> None:
    columns = {"logsout.signals[0].values": CHANNELS, "logsout.signals[1].values": {"head": 1}}
    for path in (mat, mat73):
        check_run(bha.Log.read(path, mapping=mapped(columns)))
        by_name = {"logsout.signals[pressures].values": CHANNELS, "logsout.signals[tip].values": {"head": 1}}
        check_run(bha.Log.read(path, mapping=mapped(by_name)))
    two_clocks = mapped({"logsout.signals[0].values": CHANNELS, "slow.signals.values": "q11 [m]"})
    log = bha.Log.read(mat, mapping=two_clocks)
    assert (len(log), np.isfinite(log["q11"]).sum()) == (N, len(SLOW))
    np.testing.assert_allclose(log["q11"][np.isfinite(log["q11"])], SLOW)


def test_recording_of_dspace(mat: Path) -> None:
    log = bha.Log.read(mat, mapping=mapped({"rec.Y[0].Data": "p11 [bar(g)]", "rec.Y[1].Data": "q11 [mm]"}))
    np.testing.assert_allclose(log.time, T)
    np.testing.assert_allclose(log["q11"], X[:, 0])
    named = bha.Log.read(mat, mapping=mapped({"rec.Y[p11].Data": "p11 [bar(g)]"}))
    np.testing.assert_allclose(named["p11"], log["p11"])


def test_hdf5(hdf: Path) -> None:
    check_run(bha.Log.read(hdf, mapping=mapped({"/run 1/pressures": CHANNELS, "/run 1/tip": {"head": 1}})))
    slow = {"channel": "q11 [m]", "time_unit": "ms"}
    log = bha.Log.read(hdf, mapping=mapped({"/run 1/pressures[1]": "p12 [bar(g)]", "/slow/q11": slow}))
    np.testing.assert_allclose(log.time[np.isfinite(log["q11"])], SLOW)
    flow = bha.Log.read(hdf, mapping=mapped({"/table/flow": "flow [l/min]"}))
    np.testing.assert_allclose(flow["flow"], 2 * T, rtol=1e-6)
    even = bha.Log.read(hdf, mapping=mapped({"/loose": "q11 [m]"}, rate=50.0))
    np.testing.assert_allclose(even.time, np.arange(7) / 50)
    assert any("50 rows per second" in note for note in even.notes)
    other = bha.Log.read(hdf, mapping=mapped({"/run 1/tip": {"head": 1, "time": "/table/time"}}))
    np.testing.assert_allclose(other.time, T)


def test_matlab_7_3_without_structs(mat73: Path) -> None:
    log = bha.Log.read(mat73, mapping=mapped({"tout": "t [s]", "pressures": CHANNELS}))
    np.testing.assert_allclose(log["p12"], 101_325.0 + 1e5 * P[:, 1])


def test_lists_are_mappings(mat: Path, hdf: Path, mat73: Path, tmp_path: Path) -> None:
    expected = {
        mat: ('"tout" = "t [s]"', '"rec.Y[0].Data" = "p11 [bar]"', '# "logsout.signals[1].values"', "200 x 3"),
        hdf: ('"/slow/q11" = "q11 [m]"', 'unit = "bar"', "times in /run 1/t", '# "/loose" = ""'),
        mat73: ('"logsout.signals[1].values" = { head = 1', "ts is an object of MATLAB (timeseries)", "ts.Time"),
    }
    for path, said in expected.items():
        result = run("convert", path, "--list")
        assert result.exit_code == 0, result.output
        for text in said:
            assert text in result.output
        assert tomllib.loads(result.output)["columns"]
        map_file = tmp_path / "map.toml"
        map_file.write_text(result.output)
        result = run("convert", path, "--columns", map_file, "--out", tmp_path / "out.csv")
        assert result.exit_code == 0, result.output
    with pytest.raises(LogError, match=r"A mapping file says so: bha convert .*run.mat --list"):
        bha.Log.read(mat)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"tout": "t [s]", "presures": CHANNELS}, "there is no array 'presures'; nearest: 'pressures'"),
        ({"tout": "t [s]", "title": "p11 [Pa]"}, "there is no array 'title'"),
        ({"tout": "t [s]", "pressures": "p11 [Pa]"}, "pressures: has 3 columns; 1 channel is mapped to it"),
        ({"tout": "t [s]", "pressures[3]": "p11 [Pa]"}, "the array has 3 columns, counted from 0"),
        ({"tout": "t [s]", "tip": {"head": 1, "parts": "orientation"}}, "tip: has 3 columns; a head has 3 (position)"),
        ({"tout": "t [s]", "quat": {"head": 1}}, 'Write quaternion = "wxyz" (first) or "xyzw" (last)'),
        ({"tout": "t [bar]", "tip": {"head": 1}}, "unit 'bar' does not fit; expected a time"),
        ({"pressures": "t [s]", "tip": {"head": 1}}, "times are one row or column of numbers; found 200 x 3"),
        ({"slow.time": "t [s]", "tip": {"head": 1}}, "tip: found 200 x 3; expected one axis of 50, the length of slow"),
        ({"times_gap": "t [s]", "tip": {"head": 1}}, "times_gap, row 51: found nan"),
        ({"times_back": "t [s]", "tip": {"head": 1}}, "times_back, row 2: time runs backwards"),
        ({"tip": {"head": 1, "time": "nowhere"}}, "there is no array 'nowhere'"),
    ],
)
def test_what_a_mapping_gets_wrong(mat: Path, columns: dict[str, Any], said: str) -> None:
    with pytest.raises(LogError) as error:
        bha.Log.read(mat, mapping=mapped(columns))
    assert said in str(error.value)


def test_no_times_and_stamps(hdf: Path) -> None:
    with pytest.raises(LogError, match="/loose has no times"):
        bha.Log.read(hdf, mapping=mapped({"/loose": "q11 [m]"}))
    with pytest.raises(LogError, match="stamp: is for messages of bags"):
        bha.Log.read(hdf, mapping=mapped({"/loose": "q11 [m]"}, stamp="header"))


def test_samples_that_are_no_numbers(tmp_path: Path) -> None:
    path = tmp_path / "nan.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["q11"], file["p11"] = T, np.where(T == 0.5, np.nan, T), np.where(T == 0.5, np.inf, T)
    with pytest.raises(LogError, match=r"/t, sample 51, column 'q11 \[m\]': found nan; take such samples as missing"):
        bha.Log.read(path, mapping=mapped({"/q11": "q11 [m]"}))
    assert np.isnan(bha.Log.read(path, mapping=mapped({"/q11": "q11 [m]"}), missing=True)["q11"]).sum() == 1
    with pytest.raises(LogError, match=r"column 'p11 \[bar\]': found inf"):
        bha.Log.read(path, mapping=mapped({"/p11": "p11 [bar]"}), missing=True)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.3, 0.6, 0.95])
def test_files_that_were_cut_off(mat: Path, hdf: Path, mat73: Path, tmp_path: Path, share: float) -> None:
    columns = {
        mat: {"tout": "t [s]", "cells[0][0]": "p11 [bar]", "times_back": "x [m]"},
        hdf: {"/run 1/tip": {"head": 1}},
        mat73: {"logsout.signals[0].values": CHANNELS},
    }
    for path, wanted in columns.items():
        content = path.read_bytes()
        cut = tmp_path / path.name
        cut.write_bytes(content[: int(share * len(content))])
        with pytest.raises(LogError):
            bha.Log.read(cut, mapping=mapped(wanted))
        result = run("convert", cut, "--list")
        assert result.exception is None or isinstance(result.exception, SystemExit), result.output


def test_damaged_bytes_never_end_in_a_traceback(mat: Path, hdf: Path, mat73: Path, tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    columns: dict[Path, dict[str, Any]] = {
        mat: {"tout": "t [s]", "tip": {"head": 1}},
        hdf: {"/run 1/tip": {"head": 1}},
        mat73: {"logsout.signals[0].values": CHANNELS},
    }
    for path, wanted in columns.items():
        content = np.frombuffer(path.read_bytes(), np.uint8)
        for _ in range(20):
            damaged = content.copy()
            places = random.integers(0, len(damaged), 15)
            damaged[places] = random.integers(0, 256, 15)
            broken = tmp_path / path.name
            broken.write_bytes(damaged.tobytes())
            with contextlib.suppress(LogError):
                bha.Log.read(broken, mapping=mapped(wanted), missing=True)


def test_without_the_libraries_the_extra_is_named(mat: Path, hdf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys  # noqa: PLC0415

    monkeypatch.setitem(sys.modules, "scipy.io", None)
    with pytest.raises(MissingExtraError, match=r"bha\[mat\]"):
        bha.Log.read(mat, mapping=mapped({"tout": "t [s]", "tip": {"head": 1}}))
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"bha\[hdf5\]"):
        bha.Log.read(hdf, mapping=mapped({"/loose": "q11 [m]"}))


def test_objects_of_matlab_are_named_where_they_are_mapped(mat73: Path) -> None:
    with pytest.raises(LogError, match=r"ts is an object of MATLAB \(timeseries\), which cannot be read"):
        bha.Log.read(mat73, mapping=mapped({"tout": "t [s]", "ts.Data": "p11 [Pa]"}))
