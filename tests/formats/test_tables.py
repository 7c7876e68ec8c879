"""Tables as programs export them: preambles, semicolons, tabs, decimal commas, lines of units."""

from __future__ import annotations

import gzip
import os
import threading
from pathlib import Path

import numpy as np
import pytest

import bha
from bha.errors import LogError
from bha.logs.layout import layout_of

ROWS = 40
T = np.arange(ROWS) * 0.01
P = 0.25 * np.arange(ROWS)


def rows(form: str, *, comma: bool) -> str:
    text = "\n".join(form.format(t=f"{t:.6f}", p=f"{p:.3E}") for t, p in zip(T, P, strict=True)) + "\n"
    return text.replace(".", ",") if comma else text


LABVIEW = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t{mark}
Multi_Headings\tNo
X_Columns\tOne
Time_Pref\tRelative
Operator\tsomebody "else
Date\t2024/05/08
Time\t10:33:44,3456
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t100\t100\t
Date\t2024/05/08\t2024/05/08\t
Time\t10:33:44.3\t10:33:44.3\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t
Delta_X\t0.010000\t0.010000\t
***End_of_Header***\t\t\t
X_Value\tp11\tDurchfluß [l/min]\tComment
"""
CONTROLDESK = """sep=;
Format Version;1.3
Recorder;"Recorder 1; fast"
Date;08.05.2024 10:33:44

Time;p11;Model Root/Flow
s;bar;l/min
"""


def write(folder: Path, text: str, encoding: str = "utf-8", name: str = "run.csv") -> Path:
    path = folder / name
    path.write_bytes(text.replace("\n", "\r\n").encode(encoding))
    return path


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-8-sig"])
def test_measurement_file_of_labview(tmp_path: Path, comma: bool, encoding: str) -> None:
    text = LABVIEW.format(mark="," if comma else ".") + rows("{t}\t{p}\t1.5", comma=comma)
    path = write(tmp_path, text, encoding, "run.lvm")
    columns = {"X_Value": "t [s]", "p11": "p11 [bar(g)]", "Durchfluß [l/min]": "flow [l/min]"}
    log = bha.Log.read(path, mapping={"schema": "bha-columns/1", "columns": columns})
    np.testing.assert_allclose(log.time, T)
    np.testing.assert_allclose(log["p11"], 101_325.0 + 1e5 * P)
    np.testing.assert_allclose(log["flow"], 1.5)
    decimals = ", decimal commas" if comma else ""
    assert log.notes[1] == (
        f"read as a table: fields parted by tabs{decimals}; headings in line 22, numbers from line 23 on"
    )


def test_comments_at_the_end_of_rows(tmp_path: Path) -> None:
    body = rows("{t}\t{p}\t1.5\t", comma=False).splitlines()
    body[5] += "valve opened"
    path = write(tmp_path, LABVIEW.format(mark=".") + "\n".join(body) + "\n", name="run.lvm")
    mapping = {"schema": "bha-columns/1", "columns": {"X_Value": "t [s]", "p11": "p11 [bar(g)]"}}
    assert len(bha.Log.read(path, mapping=mapping)) == ROWS


def test_export_of_controldesk_with_a_line_of_units(tmp_path: Path) -> None:
    path = write(tmp_path, CONTROLDESK + rows("{t};{p};1.5;", comma=True))
    columns = {"Time [s]": "t [s]", "p11 [bar]": "p11 [bar(g)]"}
    log = bha.Log.read(path, mapping={"schema": "bha-columns/1", "columns": columns})
    np.testing.assert_allclose(log.time, T)
    np.testing.assert_allclose(log["p11"], 101_325.0 + 1e5 * P)
    assert "semicolons, decimal commas; headings in line 6, units below them, numbers from line 8 on" in log.notes[1]
    with pytest.raises(LogError, match=r"column 'Time \[s\]' is not known; did you mean 't \[s\]'"):
        bha.Log.read(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t [s];p11 [bar(g)]\n", "semicolons; headings in line 1, numbers from line 2"),
        ("t [s];p11 [bar(g)]\n", "semicolons, decimal commas; headings in line 1"),
        ("t [s]\tp11 [bar(g)]\n", "tabs, decimal commas; headings in line 1"),
        (
            "made by;somebody\n\nt [s];p11 [bar(g)]\n",
            "semicolons, decimal commas; headings in line 3, numbers from line 4",
        ),
        ("t;p11\n[s];[bar(g)]\n", "semicolons; headings in line 1, units below them, numbers from line 3"),
        ("# a note, of, many, commas\nt [s],p11 [bar(g)]\n", "commas; headings in line 2"),
        ("Rate,100,Hz\nt,p11\ns,bar(g)\n", "commas; headings in line 2, units below them, numbers from line 4"),
        ("sep=;\nt [s];p11 [bar(g)]\n\n", "semicolons; headings in line 2, numbers from line 4"),
        ("a\nt,p11\n\ns,bar(g)\n\n\n", "commas; headings in line 2, units below them, numbers from line 7"),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_other_layouts_are_read_and_said(tmp_path: Path, text: str, words: str, packed: bool) -> None:
    separator = ";" if "semicolons" in words else "\t" if "tabs" in words else ","
    path = write(tmp_path, text + rows("{t}" + separator + "{p}", comma="decimal commas" in words))
    if packed:
        path.write_bytes(gzip.compress(path.read_bytes()))
    log = bha.Log.read(path)
    np.testing.assert_allclose(log.time, T)
    np.testing.assert_allclose(log["p11"], 101_325.0 + 1e5 * P)
    assert words in log.notes[0]


@pytest.mark.parametrize(
    "text",
    [
        "t [s],p11 [Pa]\n0,1\n1,2\n",
        "\n\nt [s],p11 [Pa],note\n0,1,a;b;c\n1,2,d;e;f\n",
        "t [s],p11 [Pa],q11 [mm]\n\n0,1,2\n1,2,3\n",
        "t [s],p11 [Pa],a,b,c\n0,1,x,y,z\n1,2,x,y,z\n",
        "t [s]\n1\n2\n",
        "",
        "one line",
        "0,1\n1,2\n",
        'a "quote\n1,2\n',
    ],
)
def test_plain_tables_and_what_is_none_stay_with_the_reader_of_csv(tmp_path: Path, text: str) -> None:
    assert layout_of(write(tmp_path, text)) is None


def test_faults_name_line_and_column(tmp_path: Path) -> None:
    body = rows("{t};{p};1.5;", comma=True).splitlines()
    head = CONTROLDESK.replace("Time;", "t;").replace("s;bar;l/min", "s;bar(g);l/min")

    def fault(line: int, text: str) -> str:
        lines = list(body)
        lines[line] = text
        path = write(tmp_path, head + "\n".join(lines) + "\n")
        with pytest.raises(LogError) as error:
            bha.Log.read(path)
        return str(error.value).removeprefix(str(path))

    assert fault(30, "1.234,5;1;1") == (
        ", line 38, column 't': found \"1.234,5\"; expected a number such as -1.5 or 2.5e3"
    )
    assert fault(30, "0,3;ab;1").startswith(", line 38, column 'p11': found \"ab\"")
    assert fault(30, "0,3;;1").startswith(", line 38, column 'p11': the cell is empty")
    assert fault(30, "0,3").startswith(", line 38: found 1 field; the headings have 3")
    assert fault(30, "0,01;1;1").startswith(", line 38, column 't': time runs backwards")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_log_through_a_pipe_is_laid_out_too(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    text = "t [s];p11 [bar(g)]\n" + rows("{t};{p}", comma=True)
    writer = threading.Thread(target=lambda: pipe.write_text(text))
    writer.start()
    log = bha.Log.read(pipe)
    writer.join()
    assert len(log) == ROWS
