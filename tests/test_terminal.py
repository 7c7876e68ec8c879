"""What commands show people: no name is cut, nothing of others is markup, no traceback but for faults of our own."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from rich.console import Console

import bha
from bha.cli import Commands, main
from bha.cli.common import reports_errors
from bha.cli.terminal import LineProgress, console, progress_bar, table

NAMES = [f"section.{s}.{key}.{k}" for s in (1, 2) for key in ("stiffness", "bending_stiffness") for k in (1, 2, 3)]
ARM = Path(bha.robots.__file__).parent / "bha_nominal.toml"


def estimates() -> object:
    shown = table("parameter", "unit", "estimate", "95 % interval", "", title="Fit [mm]", running=[""])
    for name in NAMES:
        shown.add_row(name, "N/m^3", "1234.5", "1230.1 to 1238.9", "not told by these logs [/x] [dim]")
    return shown


def shown_at(width: int, what: object) -> str:
    out = Console(width=width, file=io.StringIO(), force_terminal=True, color_system=None)
    out.print(what)
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


@pytest.mark.parametrize("width", [40, 60, 80, 100, 200])
def test_no_name_and_no_number_is_cut(width: int) -> None:
    text = shown_at(width, estimates())
    for name in NAMES:
        assert name in text
    assert text.count("1230.1 to 1238.9") == len(NAMES)
    assert "…" not in text
    assert "[mm]" in text
    assert max(map(len, text.splitlines())) <= width


def test_a_name_wider_than_the_terminal_goes_on_in_the_next_line() -> None:
    shown = table("parameter", "estimate")
    shown.add_row("x" * 50, "1.5")
    text = shown_at(30, shown)
    assert text.count("x") == 50
    assert "estimate 1.5" in text


def test_in_a_pipe_tables_are_as_wide_as_they_need(capsys: pytest.CaptureFixture[str]) -> None:
    console().print(estimates())
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(NAMES) + 5
    assert all("not told by these logs [/x] [dim]" in line for line in lines[4:-1])


@pytest.mark.skipif(sys.platform == "win32", reason="terminals of POSIX")
def test_a_command_on_a_narrow_terminal() -> None:
    import pty  # noqa: PLC0415  (not on every system)

    leader, follower = pty.openpty()
    command = [sys.executable, "-m", "bha", "info", "bha_nominal"]
    environment = {**os.environ, "COLUMNS": "60", "TERM": "xterm"}
    with subprocess.Popen(command, stdout=follower, stderr=follower, env=environment) as process:
        os.close(follower)
        text = b""
        while True:
            try:
                block = os.read(leader, 65536)
            except OSError:  # the end, as Linux says it
                break
            if not block:
                break
            text += block
    os.close(leader)
    assert process.returncode == 0
    for key in ("critical_pressure_ratio", "bellows_outer_radius", "70000, 220000", "0.00566875, 0.00566875"):
        assert key in text.decode(), key


def test_text_of_others_is_no_markup(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(ARM.read_text().replace('name = "bha_nominal"', 'name = "arm [/x] [dim]"'))
    result = CliRunner().invoke(main, ["info", str(path)])
    assert result.exit_code == 0, result.output
    assert result.output.startswith("arm [/x] [dim]: 3 sections")
    (tmp_path / "x[").mkdir()
    out = tmp_path / "x[/x][dim].csv"
    rows = ["t [s]," + ",".join(f"{name} [bar]" for name in bha.robots.load("bha_nominal").inputs)]
    rows += [f"{0.1 * k}" + ",1.1" * 9 for k in range(3)]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    result = CliRunner().invoke(main, ["simulate", str(path), "--input", str(tmp_path / "log.csv"), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert f"Written: {out}" in result.output
    assert out.is_file()


def test_control_characters_of_others_are_shown_not_obeyed(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    name = r'name = "arm \u001b[31m\u202e\u009b2J"'
    path.write_text(ARM.read_text().replace('name = "bha_nominal"', name))
    result = CliRunner().invoke(main, ["info", str(path)], color=True)
    assert result.exit_code == 0, result.output
    assert r"arm \x1b[31m\u202e\x9b2J" in result.output
    assert "\x1b[31m" not in result.output
    wrong = CliRunner().invoke(main, ["info", "x\x1b[31m.toml"])
    assert wrong.stderr == "error: x\\x1b[31m.toml: there is no such file\n"


def run(*arguments: str, stdout: int = subprocess.PIPE, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "bha", *arguments]
    return subprocess.run(
        command, stdout=stdout, stderr=subprocess.PIPE, env={**os.environ, **environment}, check=False, timeout=60
    )


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"PYTHONIOENCODING": "latin-1"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
def test_streams_that_are_not_utf8(tmp_path: Path, environment: dict[str, str]) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(ARM.read_text().replace('name = "bha_nominal"', 'name = "Rüssel 象"'), encoding="utf-8")
    done = run("info", str(path), **environment)
    assert done.returncode == 0, done.stderr
    assert b": 3 sections" in done.stdout
    assert b"bellows_outer_radius" in done.stdout
    wrong = run("info", str(tmp_path / "Rüssel.象.toml"), **environment)
    assert wrong.returncode == 1
    assert wrong.stderr.startswith(b"error: ")
    assert b"Traceback" not in wrong.stderr


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
def test_a_full_standard_output() -> None:
    with open("/dev/full", "wb") as full:
        done = run("info", "bha_nominal", stdout=full.fileno())
    assert done.returncode == 1
    assert done.stderr == b"error: output: No space left on device; make room, or name a path on another disk\n"


def test_python_m() -> None:
    done = run("--version")
    assert done.stdout.decode() == f"bha, version {bha.__version__}\n"
    assert run("--help").stdout.startswith(b"Usage: bha [OPTIONS]")


IMPORTING = """
import sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == "bha.arm":
            raise KeyboardInterrupt

sys.meta_path.insert(0, CtrlC())
sys.argv[0] = sys.argv[1]
from bha.cli import main
"""


def test_ctrl_c_during_the_import() -> None:
    command = [sys.executable, "-c", IMPORTING]
    done = subprocess.run([*command, "/usr/bin/bha"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "interrupted\n")
    # Other programs that use the package see it as always.
    done = subprocess.run([*command, "/usr/bin/study"], capture_output=True, text=True, check=False)
    assert done.returncode != 130
    assert "KeyboardInterrupt" in done.stderr


def command_that(work: object) -> Commands:
    @click.command()
    @reports_errors
    def inner() -> None:
        assert callable(work)
        work()

    return inner  # type: ignore[return-value]


def raising(error: BaseException) -> Commands:
    def work() -> None:
        raise error

    return command_that(work)


class LibraryError(Exception):
    """As of another library."""


LibraryError.__module__ = "library.inner"


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (bha.InputError("what was found"), 1, "error: what was found\n"),
        (OSError(28, "No space left on device", "/a/b"), 1, "error: /a/b: No space left on device; make room"),
        (PermissionError(13, "Permission denied", "/a/b"), 1, "error: /a/b: Permission denied; name a path that you"),
        (LibraryError("two\nlines"), 1, "error: library: two lines (BHA_TRACEBACK=1 shows where)\n"),
        (MemoryError(), 1, "error: there is not enough memory"),
        (KeyboardInterrupt(), 130, "interrupted\n"),
    ],
)
def test_errors_are_lines(error: BaseException, code: int, said: str) -> None:
    result = CliRunner().invoke(raising(error), [])
    assert result.exit_code == code
    assert result.stderr.startswith(said)
    assert isinstance(result.exception, SystemExit)


def test_faults_of_our_own_keep_their_traceback() -> None:
    assert isinstance(CliRunner().invoke(raising(KeyError("x")), []).exception, KeyError)


def test_warnings_are_lines_each_once() -> None:
    def work() -> None:
        for _ in range(2):
            warnings.warn("log.csv: the last line has no line end", bha.LogWarning, stacklevel=1)
        warnings.warn("arm.toml: odd", bha.ParameterWarning, stacklevel=1)
        click.echo("result")

    result = CliRunner().invoke(command_that(work), [])
    assert result.stdout == "result\n"
    assert result.stderr == "warning: log.csv: the last line has no line end\nwarning: arm.toml: odd\n"


def test_a_command_warns_in_lines(tmp_path: Path) -> None:
    path = tmp_path / "nonl.csv"
    names = bha.robots.load("bha_nominal").inputs
    path.write_text("t [s]," + ",".join(f"{n} [bar]" for n in names) + "\n0" + ",1.1" * 9 + "\n0.1" + ",1.1" * 9)
    result = CliRunner().invoke(main, ["simulate", "bha_nominal", "--input", str(path), "--json"])
    assert result.exit_code == 0, result.output
    assert result.stderr.startswith(f"warning: {path}: ")
    assert len(result.stderr.splitlines()) == 1


def test_progress_is_told_in_lines_where_no_terminal_is(capsys: pytest.CaptureFixture[str]) -> None:
    with LineProgress(rate_of="runs", first=0.05, between=0.05) as lines:
        task = lines.add_task("reading [/x]", total=None)
        deadline = time.monotonic() + 10.0
        text = ""
        while "reading [/x]" not in text and time.monotonic() < deadline:
            time.sleep(0.02)
            text += capsys.readouterr().err
        lines.reset(task, description="sweeping", total=200, completed=50)
        while "sweeping: 50 of 200 runs (25 %)" not in text and time.monotonic() < deadline:
            time.sleep(0.02)
            text += capsys.readouterr().err
        time.sleep(0.2)
    text += capsys.readouterr().err
    # What has not changed is not told again.
    assert [line.partition("] ")[2] for line in text.splitlines()] == [
        "reading [/x]",
        "sweeping: 50 of 200 runs (25 %)",
    ]


def test_short_work_and_machines_are_told_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar() as lines:
        assert isinstance(lines, LineProgress)
        lines.update(lines.add_task("x", total=1.0), completed=1.0)
    hidden = progress_bar(hidden=True)
    assert not isinstance(hidden, LineProgress)
    with hidden:
        hidden.update(hidden.add_task("x", total=1.0), completed=1.0)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "arguments",
    [
        ("control", "bha_nominal", "--out", "none/a.csv"),
        ("control", "bha_nominal", "--plot", "none/a.png"),
        ("excite", "bha_nominal", "--out", "none/a.csv"),
        ("identify", "bha_nominal", "no_such_log.csv", "--out", "none/a.toml"),
        ("simulate", "bha_nominal", "--input", "no_such_log.csv", "--out", "none/a.csv"),
    ],
)
def test_where_results_go_is_looked_at_before_the_work(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, list(arguments))
    assert result.exit_code == 1
    assert f"the folder {tmp_path / 'none'} does not exist; create it first" in result.stderr
