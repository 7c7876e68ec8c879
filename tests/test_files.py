"""Files are written whole or not at all, keep their permissions, and say what the system has against them."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

import bha
from bha.support.files import UNFINISHED, check_target, make_folder, written_whole


def write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(text)


def test_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write(path, "old")

    def fail() -> None:
        with written_whole(path) as temporary:
            assert temporary.suffix == ".csv"
            temporary.write_text("half")
            raise KeyError("made up")

    with pytest.raises(KeyError):
        fail()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.csv"]


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
def test_permissions_are_those_of_the_file_before(tmp_path: Path) -> None:
    mask = os.umask(0o027)
    try:
        fresh, old = tmp_path / "fresh.csv", tmp_path / "old.csv"
        write(fresh, "new")
        assert stat.S_IMODE(fresh.stat().st_mode) == 0o640
        for mode in (0o600, 0o444, 0o666, 0o755):
            old.touch()
            old.chmod(mode)
            with written_whole(old) as temporary:
                # Nobody else may read what is not finished either.
                assert stat.S_IMODE(temporary.stat().st_mode) & 0o077 & ~mode == 0
                temporary.write_text("new")
            assert stat.S_IMODE(old.stat().st_mode) == mode
            old.chmod(0o600)
    finally:
        os.umask(mask)


def test_a_link_keeps_pointing_where_it_points(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "there/real.csv")
    write(tmp_path / "link.csv", "new")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "there/real.csv").read_text() == "new"


KILLED = """
import sys, time
from pathlib import Path
from bha.support.files import written_whole
with written_whole(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("in", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_what_a_killed_process_left_goes_when_the_file_is_written_again(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process:
        assert process.stdout.readline() == "in\n"
        # While it writes, others may: each in a file of its own.
        write(path, "of another")
        assert path.read_text() == "of another"
        assert len(list(tmp_path.glob(f"{UNFINISHED}*"))) == 1
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert len(list(tmp_path.glob(f"{UNFINISHED}*"))) == 1
    write(path, "at last")
    assert path.read_text() == "at last"
    assert os.listdir(tmp_path) == ["a.csv"]


def test_a_temporary_name_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("of the user")
    (tmp_path / f"{UNFINISHED}.a.csv").symlink_to(victim)
    write(tmp_path / "a.csv", "new")
    assert victim.read_text() == "of the user"
    assert (tmp_path / f"{UNFINISHED}.a.csv").is_symlink()


def test_names_of_any_length(tmp_path: Path) -> None:
    for name in ("x" * 240 + ".csv", "ä" * 120 + ".csv", "a"):
        write(tmp_path / name, "text")
        assert (tmp_path / name).read_text() == "text"
    with pytest.raises(bha.FileError, match="use a shorter name"):
        write(tmp_path / ("x" * 252 + ".csv"), "text")
    assert len(os.listdir(tmp_path)) == 3


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path, text in (
        (tmp_path, "is a folder; name a file"),
        (tmp_path / "none/a.csv", "does not exist; create it first"),
        (tmp_path / "file/a.csv", "does not exist; create it first"),
        (Path(os.devnull), "is a device or a pipe"),
        (tmp_path / "a\0b", "a path has no zero character"),
    ):
        with pytest.raises(bha.InputError, match=text):
            write(path, "text")
        with pytest.raises(bha.InputError, match=text):
            check_target(path)
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(bha.FileError, match=r"loop: cannot be written"):
        write(tmp_path / "loop", "text")
    check_target(tmp_path / "new.csv")
    check_target(tmp_path / "file")
    check_target(None)
    assert sorted(os.listdir(tmp_path)) == ["file", "loop"]
    with pytest.raises(bha.InputError, match="is a file; name a folder"):
        make_folder(tmp_path / "file")
    with pytest.raises(bha.FileError, match="not something below a file"):
        make_folder(tmp_path / "file/folder")


FULL = """
import resource, signal, sys
import bha
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
arm = bha.robots.load("bha_nominal")
import numpy as np
time = np.linspace(0.0, 0.5, 1000)
run = bha.simulate(arm, bha.Input(time, np.full((1000, 9), 1.2e5)))
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
for name in sys.argv[1:]:
    try:
        run.write(name)
    except bha.FileError as error:
        assert isinstance(error, OSError)
        print(error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
def test_a_full_disk_is_an_error_that_names_the_file(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    paths = [tmp_path / f"a{suffix}" for suffix in (".csv", ".csv.gz", ".npz", ".parquet")]
    done = subprocess.run([sys.executable, "-c", FULL, *map(str, paths)], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert len(lines) == len(paths)
    for path, line in zip(paths, lines, strict=True):
        assert line.startswith(f"{path}: cannot be written: ")
        assert "File too large; raise the limit of file sizes" in line
    assert os.listdir(tmp_path) == []


def test_locks_are_given_back(tmp_path: Path) -> None:
    begin = time.monotonic()
    for k in range(20):
        write(tmp_path / "a.csv", str(k))
    assert time.monotonic() - begin < 20.0
    assert os.listdir(tmp_path) == ["a.csv"]


def test_a_log_that_is_read_is_not_written_over(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("measured once")
    (tmp_path / "link.csv").symlink_to(log)
    (tmp_path / "folder").mkdir()
    for path in (log, tmp_path / "link.csv", tmp_path / "folder" / ".." / "log.csv"):
        with pytest.raises(
            bha.InputError, match=r"log\.csv: is a log that is read, and logs stay as they are|link\.csv: is"
        ):
            check_target(path, keep=[tmp_path / "not_there.csv", log])
    check_target(tmp_path / "new.csv", keep=[log])
    check_target(log, keep=[tmp_path / "not_there.csv"])
