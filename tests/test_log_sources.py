"""Where logs come from and what they may lack: pipes, Parquet of other programs, missing samples."""

import gzip
import hashlib
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from bha import Log
from bha.errors import InputError, LogError

TEXT = "t [s],p11 [bar],q11 [mm],x1 [m],fx1 [N],wire [mm]\n0,1,150,0.5,0,1\n1,2,{q11},{x1},0,{wire}\n"
HOLD = "write the last known value, as a sensor that holds it would, or remove the row"


def write(folder: Path, text: str) -> Path:
    path = folder / "log.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize("word", ["", "NaN", "nan", "NA", "null", "-", " n/a "])
def test_samples_may_be_missing_where_the_caller_says_so(word: str, tmp_path: Path) -> None:
    path = write(tmp_path, TEXT.format(q11=word, x1=word, wire=word))
    log = Log.read(path, missing=True)
    assert log.missing
    for name, first in (("q11", 0.15), ("x1", 0.5), ("wire", 1.0)):
        np.testing.assert_array_equal(log[name], [first, np.nan])
    assert log.lengths is not None
    np.testing.assert_array_equal(log.lengths[:, 0], [0.15, np.nan])
    with pytest.raises(LogError) as caught:
        Log.read(path)
    found = f'found "{word.strip()}", no value' if word.strip() else "the cell is empty"
    expected = (
        f"{path}, line 3, column 'q11 [mm]': {found}; {HOLD}, or take such cells as missing samples (--missing; in"
    )
    assert str(caught.value).startswith(expected)


@pytest.mark.parametrize(
    ("heading", "why"),
    [
        ("t [s]", "a row without a time has no place in the log: write the time or remove the row"),
        ("p11 [Pa]", f"{HOLD}: pressures drive the arm and may not be missing"),
        ("pc1_12 [Pa]", f"{HOLD}: pressures drive the arm and may not be missing"),
        ("fz2 [N]", f"{HOLD}: forces drive the arm and may not be missing"),
    ],
)
@pytest.mark.parametrize("missing", [False, True])
def test_what_drives_the_arm_can_miss_no_sample(heading: str, why: str, missing: bool, tmp_path: Path) -> None:
    headings, cells = (f"{heading},a", ",1") if heading == "t [s]" else (f"t [s],{heading}", "0,")
    with pytest.raises(LogError) as caught:
        Log.read(write(tmp_path, f"{headings}\n{cells}\n"), missing=missing)
    assert str(caught.value).endswith(f"line 2, column '{heading}': the cell is empty; {why}")


@pytest.mark.parametrize("word", ["inf", "-Infinity", "1e999"])
def test_infinity_is_no_missing_sample(word: str, tmp_path: Path) -> None:
    with pytest.raises(LogError, match="expected a finite number"):
        Log.read(write(tmp_path, TEXT.format(q11=word, x1=1, wire=1)), missing=True)
    log = Log.read(write(tmp_path, TEXT.format(q11=1, x1=1, wire=word)), missing=True)
    assert log.ignored == {"wire": f"line 3: '{word}' is not a number"}


@pytest.mark.parametrize("name", ["again.csv", "again.parquet"])
def test_missing_samples_are_written_and_read_back(name: str, tmp_path: Path) -> None:
    if name.endswith(".parquet"):
        pytest.importorskip("pyarrow")
    log = Log.read(write(tmp_path, TEXT.format(q11="", x1="NaN", wire="")), missing=True)
    log.write(tmp_path / name)
    assert Log.read(tmp_path / name, missing=True) == log
    with pytest.raises(LogError, match=r"no value|the cell is empty"):
        Log.read(tmp_path / name)


def test_missing_samples_in_parquet(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "log.parquet"
    columns = {"t [s]": [0.0, 1.0], "q11 [mm]": [150.0, None], "x1 [m]": pyarrow.array([0.5, None], pyarrow.float32())}
    parquet.write_table(pyarrow.table(columns), path)
    np.testing.assert_array_equal(Log.read(path, missing=True)["q11"], [0.15, np.nan])
    with pytest.raises(LogError, match=r"row 2, column 'q11 \[mm\]': the cell is empty; write the last known value"):
        Log.read(path)
    parquet.write_table(pyarrow.table({"t [s]": [0.0, None]}), path)
    with pytest.raises(LogError, match=r"row 2, column 't \[s\]': the cell is empty; a row without a time"):
        Log.read(path, missing=True)


def test_parquet_with_a_group_that_is_named_like_a_column(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "log.parquet"
    columns = {"pose": [{"x": "a"}, {"x": "b"}], "t [s]": [0.0, 1.0], "pose.x": [3.0, 4.0]}
    parquet.write_table(pyarrow.table(columns), path)
    log = Log.read(path)
    np.testing.assert_array_equal(log["pose.x"], [3.0, 4.0])
    assert log.ignored["pose"] == "struct<x: string> is not a type of numbers"


def test_parquet_whose_names_are_no_text(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "log.parquet"
    parquet.write_table(pyarrow.table({"t [s]": [0.0], "wXYZ": [1.0]}), path, store_schema=False)
    path.write_bytes(path.read_bytes().replace(b"wXYZ", b"w\xff\xfe\xff"))
    with pytest.raises(LogError, match=r"log.parquet: a column's name is not UTF-8 text; rename it"):
        Log.read(path)


pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")


@pipes
@pytest.mark.parametrize("kind", ["csv", "gzip", "parquet"])
def test_a_log_may_come_through_a_pipe(kind: str, tmp_path: Path) -> None:
    file = write(tmp_path, TEXT.format(q11=150, x1=1, wire=1))
    if kind == "parquet":
        pytest.importorskip("pyarrow")
        Log.read(file).write(tmp_path / "log.parquet")
        file = tmp_path / "log.parquet"
    content = gzip.compress(file.read_bytes()) if kind == "gzip" else file.read_bytes()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(content,))
    writer.start()
    log = Log.read(pipe)
    writer.join()
    assert log == Log.read(file)
    assert log.path == pipe
    assert log.sha256 == hashlib.sha256(content).hexdigest()


@pipes
def test_faults_in_a_pipe_name_the_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(b"t [s]\n0\nx\n",))
    writer.start()
    with pytest.raises(LogError) as caught:
        Log.read(pipe)
    writer.join()
    assert str(caught.value).startswith(f"{pipe}, line 3, column 't [s]': found \"x\"")


@pytest.mark.skipif(not os.path.exists("/dev/stdin"), reason="needs /dev/stdin")
def test_a_log_may_come_from_standard_input(tmp_path: Path) -> None:
    text = TEXT.format(q11=150, x1=1, wire=1)
    code = "import bha; log = bha.Log.read('/dev/stdin'); print(len(log), log.sha256)"
    done = subprocess.run(
        [sys.executable, "-c", code], input=text, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.split() == ["2", hashlib.sha256(text.encode()).hexdigest()]


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="needs /dev/zero")
def test_a_device_is_no_log() -> None:
    with pytest.raises(LogError, match=r"/dev/zero: is a device; a log is a file, or comes through a pipe"):
        Log.read("/dev/zero")


def test_arguments_are_checked(tmp_path: Path) -> None:
    path = write(tmp_path, TEXT.format(q11=1, x1=1, wire=1))
    with pytest.raises(InputError, match=r"columns: found the text 'p11'; expected names, such as \['p11'\]"):
        Log.read(path, columns="p11")
    for ambient in (None, "1e5", True, -1.0, np.array([1e5])):
        with pytest.raises(InputError, match=r"ambient_pressure: found .*; allowed: a finite number >= 0"):
            Log.read(path, ambient_pressure=ambient)  # type: ignore[arg-type]
    with pytest.raises(LogError, match="cannot be read"):
        Log.read("log\0.csv")
