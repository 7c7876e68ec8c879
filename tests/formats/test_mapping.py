"""Mapping files: what they may say, what is wrong with them, and which one counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import bha
from bha.cli import main
from bha.errors import LogError

HEAD = 'schema = "bha-columns/1"\n'
TABLE = "Time (ms),Druck A (bar),Weg,Notiz\n0,0.0,150.0,a\n10,0.4,150.1,b\n20,0.9,150.3,c\n"
COLUMNS = '[columns]\n"Time (ms)" = "t [ms]"\n"Druck A (bar)" = "p11 [bar(g)]"\n"Weg" = "q11 [mm]"\n'


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "run.csv"
    path.write_text(TABLE)
    return path


def test_columns_of_a_table_by_a_mapping(table: Path, tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no column of time"):
        bha.Log.read(table)
    own = table.with_name("run.csv.columns.toml")
    own.write_text(HEAD + COLUMNS)
    log = bha.Log.read(table)
    assert log.columns == ("t", "p11", "q11")
    assert (log["p11"][1], log["q11"][2], log.time[2]) == pytest.approx((101_325.0 + 0.4e5, 0.1503, 0.02))
    assert log.notes == (f"columns by {own}",)
    out = tmp_path / "new.csv"
    assert run("convert", table, "--out", out).exit_code == 0
    assert out.read_text().splitlines()[0] == "t [ms],p11 [bar(g)],q11 [mm]"
    assert bha.Log.read(out) == log


def test_a_mapping_of_the_folder_is_not_for_tables(table: Path) -> None:
    """Whose headings say what they are."""
    table.write_text("t [s],p11 [Pa(g)]\n0,0\n1,0\n")
    (table.parent / "columns.toml").write_text(HEAD + COLUMNS)
    assert bha.Log.read(table).notes == ()
    with pytest.raises(LogError, match=r"there is no column 'Time \(ms\)'"):
        bha.Log.read(table, mapping=table.parent / "columns.toml")


def test_the_list_of_a_table_is_its_mapping(table: Path) -> None:
    text = run("convert", table, "--list").output
    assert '"Time (ms)" = "t [ms]"' in text
    assert '# "Weg" = ""' in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "schema: missing; a mapping file begins with"),
        ('schema = "bha-arm/1"\n', "schema: found 'bha-arm/1'"),
        (HEAD, "columns: missing; expected a table such as"),
        (HEAD + "[columns]\n", "columns: missing"),
        (HEAD + "[column]\n", "column: unknown key; nearest allowed: 'columns'"),
        (HEAD + '[columns]\na = "q11"\n', "\"a\": 'q11' has no unit; write it as 'q11 [m]'"),
        (HEAD + '[columns]\na = ""\n', "found an empty channel"),
        (HEAD + "[columns]\na = 3\n", 'found 3; expected a heading such as "p11 [bar(g)]"'),
        (HEAD + '[columns]\na = { chanel = "q11 [m]" }\n', "chanel: unknown key; nearest allowed: 'channel'"),
        (HEAD + '[columns]\na = { head = 1, channel = "x1 [m]" }\n', "found channel and head; expected one of"),
        (HEAD + "[columns]\na = { head = 0 }\n", "head: found 0; allowed: the number of a section"),
        (HEAD + '[columns]\na = { head = 1, quaternion = "zyxw" }\n', "quaternion: found 'zyxw'; allowed"),
        (HEAD + '[columns]\na = { head = 1, parts = "angle" }\n', "parts: found 'angle'; allowed"),
        (HEAD + '[columns]\na = { channel = "q11 [m]", parts = "position" }\n', "parts belongs to a head"),
        (HEAD + "[columns]\na = { channels = [] }\n", "channels: found []; expected names in order"),
        (HEAD + '[columns]\na = "q11 [m]"\nb = "q11 [mm]"\n', '"b": q11 is mapped to "a" already'),
        (HEAD + '[time]\nstamp = "sent"\n' + COLUMNS, "stamp: found 'sent'; allowed"),
        (HEAD + "[time]\nrate = -1\n" + COLUMNS, "rate: found -1; allowed: a number > 0"),
        (HEAD + "time = 3\n" + COLUMNS, "time: found 3; expected a table"),
        ("[columns\n", "not a TOML file"),
        (HEAD + '[columns]\n"Weg" = { head = 1 }\n', '"Weg": columns of a table are one channel each'),
        (HEAD + '[columns]\n"Wge" = "q11 [m]"\n', "there is no column 'Wge'; nearest: 'Weg'"),
        (HEAD + "[time]\nrate = 10\n" + COLUMNS, "rate: a table has a column of time"),
        (HEAD + '[columns]\n"Weg" = { channel = "q11 [m]", time = "x" }\n', "all columns of a table have its times"),
    ],
)
def test_what_is_wrong_with_a_mapping_is_said(table: Path, text: str, said: str) -> None:
    path = table.with_name("map.toml")
    path.write_text(text)
    with pytest.raises(LogError) as error:
        bha.Log.read(table, mapping=path)
    assert said in str(error.value)


def test_mapping_files_that_cannot_be_read(table: Path) -> None:
    with pytest.raises(LogError, match="the mapping file cannot be read: No such file"):
        bha.Log.read(table, mapping=table.with_name("none.toml"))
    binary = table.with_name("binary.toml")
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(LogError, match="not a TOML file"):
        bha.Log.read(table, mapping=binary)
    large = table.with_name("large.toml")
    large.write_bytes(b"#" * (2 << 20))
    with pytest.raises(LogError, match="is larger than a mapping file may be"):
        bha.Log.read(table, mapping=large)


def test_every_fault_of_a_mapping_is_named(table: Path) -> None:
    mapping: dict[str, Any] = {"schema": "bha-columns/1", "columns": {"a": 3, "b": "q11"}, "extra": 1}
    with pytest.raises(LogError) as error:
        bha.Log.read(table, mapping=mapping)
    assert len(str(error.value).splitlines()) == 3


def test_several_logs_go_into_a_folder(tmp_path: Path) -> None:
    logs = [tmp_path / name for name in ("one.csv", "two.csv")]
    for log in logs:
        log.write_text("t [s],p11 [kPa(g)]\n0,0\n1,2\n")
    result = run("convert", *logs, "--out", tmp_path / "new", "--json")
    assert result.exit_code == 0, result.output
    assert (tmp_path / "new" / "two.csv").read_text() == "t [s],p11 [kPa(g)]\n0.0,0.0\n1.0,2.0\n"
    assert "two of the logs would become this file" in run("convert", *logs[:1] * 2, "--out", tmp_path / "new").output
    assert "is a file; name a folder" in run("convert", *logs, "--out", logs[0]).output


def test_a_log_does_not_become_itself(tmp_path: Path) -> None:
    text = "t [ms],p11 [Pa]\n0,1\n1,2\n"
    for name in ("one.csv", "two.csv"):
        (tmp_path / name).write_text(text)
    for arguments in (["one.csv", "--out", "one.csv"], ["one.csv", "two.csv", "--out", "."]):
        result = run("convert", *[tmp_path / word if not word.startswith("--") else word for word in arguments])
        assert result.exit_code == 1
        assert "one.csv: is a log that is read" in result.output
    assert (tmp_path / "one.csv").read_text() == text


def test_wrong_options_of_convert(table: Path) -> None:
    assert "--out: not given" in run("convert", table).output
    assert "--list prints what one file has" in run("convert", table, table, "--list").output
    table.write_text("t [s],p11 [kPa(g)]\n0,0\n1,2\n")
    assert "is a log that is read" in run("convert", table, "--out", table).output
    assert "unknown extension .mat" in run("convert", table, "--out", table.with_suffix(".mat")).output
    assert "there is no such file" in run("convert", table.with_name("none.csv"), "--list").output
    assert "is a folder" in run("convert", table.parent, "--list").output
