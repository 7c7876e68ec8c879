"""Trajectories and their files, read back with readers that are not ours."""

from __future__ import annotations

import copy
import csv
import gzip
import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bha import names
from bha.errors import InputError, MissingExtraError
from bha.runs import formats
from bha.runs.trajectory import Trajectory, TrajectoryWriter

HEADINGS = [
    *("t [s]", "q11 [m]", "q12 [m]", "q13 [m]", "q21 [m]", "q22 [m]", "q23 [m]"),
    *("qd11 [m/s]", "qd12 [m/s]", "qd13 [m/s]", "qd21 [m/s]", "qd22 [m/s]", "qd23 [m/s]"),
    *("p11 [Pa]", "p12 [Pa]", "p13 [Pa]", "p21 [Pa]"),
    *("x1 [m]", "y1 [m]", "z1 [m]", "x2 [m]", "y2 [m]", "z2 [m]"),
]


def make(rows: int = 7, start: float = 0.0, seed: int = 1) -> Trajectory:
    random = np.random.default_rng(seed)
    return Trajectory(
        time=start + 0.1 * np.arange(rows),
        lengths=random.normal(size=(rows, 6)),
        velocities=random.normal(size=(rows, 6)),
        pressures=random.normal(size=(rows, 4)) * 1e5,
        head_positions=random.normal(size=(rows, 2, 3)),
        input_names=("p11", "p12", "p13", "p21"),
        statistics={"steps": 70, "rejected_steps": 1, "evaluations": 421},
        arm_name="two sections",
    )


def read_csv(path: Path) -> tuple[list[str], np.ndarray]:
    with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as file:
        headings, *rows = csv.reader(file)
    return headings, np.array(rows, dtype=np.float64)


def read_parquet(path: Path) -> tuple[list[str], np.ndarray]:
    table = pytest.importorskip("pyarrow.parquet").read_table(path)
    return table.column_names, np.column_stack([column.to_numpy() for column in table.columns])


def read_npz(path: Path) -> tuple[list[str], np.ndarray]:
    with np.load(path, allow_pickle=False) as file:
        statistics = json.loads(str(file["statistics"]))
        fields = {name: file[name] for name in formats.ARRAYS}
        read = Trajectory(**fields, input_names=tuple(file["input_names"].tolist()), statistics=statistics)
        assert file["arm_name"] == "two sections"
        return read.columns(), read.table()


FORMATS: list[tuple[str, Callable[[Path], tuple[list[str], np.ndarray]]]] = [
    ("run.csv", read_csv),
    ("run.csv.gz", read_csv),
    ("run.parquet", read_parquet),
    ("RUN.NPZ", read_npz),
]
every_format = pytest.mark.parametrize(("name", "read"), FORMATS, ids=[name for name, _ in FORMATS])


def test_names() -> None:
    assert names.length_name(1, 3) == "q13"
    assert names.velocity_name(2, 1) == "qd21"
    assert names.pressure_name(3, 12) == "p3_12"
    assert names.commanded_pressure_name(10, 1) == "pc10_1"
    assert names.position_names(12) == ("x12", "y12", "z12")
    assert names.force_names(3) == ("fx3", "fy3", "fz3")
    every = [names.length_name(section, number) for section in range(1, 120) for number in range(1, 120)]
    assert len(set(every)) == len(every)
    inputs = [("p11", 1), ("pc23", 2), ("p3_12", 3), ("p10_1", 10), ("p111", None), ("valve", None), ("p01", None)]
    assert [names.section_of_pressure(name) for name, _ in inputs] == [section for _, section in inputs]
    with pytest.raises(InputError, match="section number is 0"):
        names.length_name(0, 1)


@every_format
def test_a_file_holds_every_bit(tmp_path: Path, name: str, read: Callable[[Path], Any]) -> None:
    trajectory = make()
    assert trajectory.write(tmp_path / name) == tmp_path / name
    headings, values = read(tmp_path / name)
    assert headings == HEADINGS
    expected = [trajectory.time, *trajectory.lengths.T, *trajectory.velocities.T, *trajectory.pressures.T]
    expected += [*trajectory.head_positions[:, 0].T, *trajectory.head_positions[:, 1].T]
    np.testing.assert_array_equal(values, np.column_stack(expected))
    assert [path.name for path in tmp_path.iterdir()] == [name]


@every_format
def test_chunks_give_the_file_of_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, read: Callable[[Path], Any]
) -> None:
    whole = make(rows=50)
    monkeypatch.setattr(formats, "BLOCK_ROWS", 16)
    (tmp_path / "whole").mkdir()
    whole.write(tmp_path / "whole" / name)
    with TrajectoryWriter(tmp_path / name) as writer:
        for start in range(0, 50, 7):
            writer.append(whole[start : start + 7])
    headings, values = read(tmp_path / name)
    assert headings == whole.columns()
    np.testing.assert_array_equal(values, whole.table())
    assert writer.rows == 50
    if not name.endswith(".parquet"):
        again = tmp_path / "again" / name
        again.parent.mkdir()
        whole.write(again)
        assert again.read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_parquet_carries_the_statistics_and_splits_into_row_groups(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    monkeypatch.setattr(formats, "BLOCK_ROWS", 4)
    with TrajectoryWriter(tmp_path / "run.parquet") as writer:
        writer.append(make(rows=3))
        writer.append(make(rows=3, start=1.0))
        writer.append(make(rows=1, start=2.0))
    file = parquet.ParquetFile(tmp_path / "run.parquet")
    assert [file.metadata.row_group(i).num_rows for i in range(file.metadata.num_row_groups)] == [4, 2, 1]
    metadata = file.metadata.metadata
    assert json.loads(metadata[b"bha.statistics"]) == {"steps": 210, "rejected_steps": 3, "evaluations": 1263}
    assert metadata[b"bha.arm_name"] == b"two sections"
    assert json.loads(metadata[b"bha.input_names"]) == ["p11", "p12", "p13", "p21"]


@every_format
def test_an_error_leaves_the_old_file(tmp_path: Path, name: str, read: Callable[[Path], Any]) -> None:
    (tmp_path / name).write_bytes(b"old")
    with pytest.raises(ZeroDivisionError), TrajectoryWriter(tmp_path / name) as writer:  # noqa: PT012
        writer.append(make())
        raise ZeroDivisionError
    assert (tmp_path / name).read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


@every_format
def test_keep_partial_finishes_the_file(tmp_path: Path, name: str, read: Callable[[Path], Any]) -> None:
    with (  # noqa: PT012
        pytest.raises(KeyboardInterrupt),
        TrajectoryWriter(tmp_path / name, keep_partial=True) as writer,
    ):
        writer.append(make())
        raise KeyboardInterrupt
    _, values = read(tmp_path / name)
    np.testing.assert_array_equal(values, make().table())
    assert len(list(tmp_path.iterdir())) == 1


def test_keep_partial_without_rows_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), TrajectoryWriter(tmp_path / "run.csv", keep_partial=True) as writer:  # noqa: PT012
        writer.append(make(rows=0))
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_chunks_must_fit_together(tmp_path: Path) -> None:
    def write(*chunks: Trajectory) -> None:
        with TrajectoryWriter(tmp_path / "run.csv") as writer:
            for chunk in chunks:
                writer.append(chunk)

    with pytest.raises(InputError, match=r"starts at 0\.0 s, before the end of the last one, 0\.6"):
        write(make(), make())
    other = Trajectory(**{**vars(make(start=5.0)), "input_names": ("a", "b", "c", "d")})
    with pytest.raises(InputError, match="a chunk has the columns"):
        write(make(), other)
    assert list(tmp_path.iterdir()) == []


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "data" / "run.csv")
    make().write(tmp_path / "link.csv")
    assert (tmp_path / "link.csv").is_symlink()
    assert read_csv(tmp_path / "data" / "run.csv")[0] == HEADINGS


def test_where_it_cannot_write_it_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"unknown extension \.xlsx; .* \.parquet, \.csv, \.csv\.gz or \.npz"):
        make().write(tmp_path / "run.xlsx")
    with pytest.raises(InputError, match="does not exist; create it first"):
        make().write(tmp_path / "missing" / "run.csv")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'bha\[parquet\]'"):
        make().write(tmp_path / "run.parquet")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": np.zeros((7, 1))}, r"time: expected shape \(m,\)"),
        ({"time": np.array([0, 1, 2, 1, 4, 5, 6.0])}, r"must not decrease, found 2.0 s then 1.0 s at row 3"),
        ({"lengths": np.zeros((7, 5))}, r"lengths: expected shape \(m, 3n\) with n >= 1, found \(7, 5\)"),
        ({"velocities": np.zeros((7, 3))}, r"velocities: expected shape \(7, 6\), found \(7, 3\)"),
        ({"head_positions": np.zeros((7, 6))}, r"head_positions: expected shape \(7, 2, 3\)"),
        ({"input_names": ("p11", "p12", "p13")}, r"pressures: expected shape \(7, 3\), found \(7, 4\)"),
        ({"input_names": ("p11", "p12", "p13", "p11")}, r"p11 \[Pa\] would stand twice"),
    ],
)
def test_wrong_arrays_are_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Trajectory(**{**vars(make()), **change})


def test_a_trajectory_is_read_only_and_pickles() -> None:
    lengths = np.zeros((7, 6))
    trajectory = Trajectory(**{**vars(make()), "lengths": lengths})
    with pytest.raises(ValueError, match="read-only"):
        trajectory.lengths[0, 0] = 1.0
    lengths[0, 0] = 1.0  # the caller's own array stays writeable
    again = pickle.loads(pickle.dumps(trajectory))
    np.testing.assert_array_equal(again.table(), trajectory.table())
    assert len(trajectory[2:5]) == 3
    np.testing.assert_array_equal(trajectory[2:5].table(), trajectory.table()[2:5])


def test_equality_is_that_of_the_arrays() -> None:
    trajectory = make()
    again = make()
    object.__setattr__(again, "statistics", {"steps": 1})
    assert trajectory == again
    assert hash(trajectory) == hash(again)
    assert trajectory != make(seed=2)
    assert trajectory != make(rows=6)
    assert trajectory != trajectory[:6]
    assert trajectory[:0] == make(seed=2)[:0]
    assert trajectory != replace(trajectory, arm_name="another")
    assert trajectory != replace(trajectory, measured_lengths=trajectory.lengths)
    assert trajectory != "a trajectory"
    gaps = trajectory.velocities.copy()
    gaps[3] = np.nan
    assert replace(trajectory, velocities=gaps) == replace(trajectory, velocities=gaps.copy())


def test_a_line_says_what_it_is() -> None:
    assert repr(make()) == "<Trajectory of two sections: 7 rows, 0 to 0.6 s, 2 sections, 4 inputs>"
    assert repr(make()[:0]) == "<Trajectory of two sections: 0 rows, 2 sections, 4 inputs>"
    assert len(make()) == 7


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda t: pickle.loads(pickle.dumps(t))])
def test_copies_are_equal_and_read_only(again: Callable[[Trajectory], Trajectory]) -> None:
    trajectory = replace(make(), measured_lengths=np.zeros((7, 6)))
    copied = again(trajectory)
    assert copied == trajectory
    for name in (*formats.ARRAYS, "measured_lengths"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(copied, name)[0] = 1.0


@pytest.mark.parametrize("time", [np.nan, np.inf])
def test_times_are_finite(time: float) -> None:
    with pytest.raises(InputError, match=r"time: found (nan|inf) at row 6; expected finite numbers, s"):
        replace(make(), time=[*make().time[:6], time])
