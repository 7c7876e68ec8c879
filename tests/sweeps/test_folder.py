"""The folder of a sweep: goes on after any end, nothing lost or doubled, and never mixes two sweeps."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import bha
import bha.sweeps
from bha import _core
from bha.cli import main
from bha.sweeps.folder import locked

from .small_sweeps import assert_same, slow, spec, toml

pytest.importorskip("pyarrow")


#: One that this processor lacks.
FOREIGN = "avx2" if "neon" in _core.instruction_sets() else "neon"


def partitions(out: Path) -> list[Path]:
    return sorted(out.glob("part-*.parquet"))


def start(file: Path, out: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", "from bha.cli import main; main()", "sweep", str(file), "--out", str(out)]
    return subprocess.Popen([*command, "--threads", "1"], stderr=subprocess.PIPE, text=True)


def wait_for(out: Path, count: int, process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 60.0
    while len(partitions(out)) < count:
        assert process.poll() is None, process.stderr.read() if process.stderr else ""
        assert time.monotonic() < deadline, "no partition came"
        time.sleep(0.01)


def test_goes_on_after_kill(tmp_path: Path) -> None:
    """SIGKILL in the middle, a file half written: what was there is untouched, the rest comes as without the kill."""
    mapping, out = slow(tmp_path, 6), tmp_path / "out"
    process = start(toml(mapping, tmp_path / "sweep.toml"), out)
    wait_for(out, 2, process)
    process.kill()
    process.communicate()
    before = {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in partitions(out)}
    assert 2 <= len(before) < 6
    (out / ".bha-tmp.part-000005.parquet").write_bytes(b"PAR1 and no more")
    (out / ".0123abcd.part-000004.parquet").write_bytes(b"of an earlier version")
    counts: list[tuple[int, int]] = []
    summary = bha.sweep(mapping, out, threads=1, progress=lambda done, runs: counts.append((done, runs)))
    assert summary.complete
    assert counts[0] == (64 * len(before), 374)
    assert counts[-1] == (374, 374)
    for path in partitions(out)[: len(before)]:
        assert (path.stat().st_ino, path.stat().st_mtime_ns) == before[path.name]
    assert {path.name for path in out.iterdir()} == {
        "sweep.json", ".lock", *(f"part-{number:06d}.parquet" for number in range(6))
    }  # fmt: skip
    bha.sweep(mapping, tmp_path / "whole", threads=1)
    assert bha.sweeps.read(out).column("run").to_pylist() == list(range(374))
    assert_same(bha.sweeps.read(out), bha.sweeps.read(tmp_path / "whole"))


def test_ctrl_c_leaves_finished_partitions(tmp_path: Path) -> None:
    mapping, out = slow(tmp_path, 40), tmp_path / "out"
    process = start(toml(mapping, tmp_path / "sweep.toml"), out)
    wait_for(out, 1, process)
    process.send_signal(signal.SIGINT)
    _, text = process.communicate(timeout=30)
    assert process.returncode == 130
    finished = len(partitions(out))
    assert f"interrupted: {finished} of 40 partitions are in {out}; the same command goes on" in text
    assert bha.sweeps.read(out).num_rows == 64 * finished
    assert not bha.sweeps.summarize(out).complete


def test_a_lost_partition_is_computed_again(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path), tmp_path / "out"
    bha.sweep(mapping, out)
    whole = bha.sweeps.read(out)
    partitions(out)[1].unlink()
    assert bha.sweeps.summarize(out).done == 136
    bha.sweep(mapping, out)
    assert_same(bha.sweeps.read(out), whole)
    stamps = [path.stat().st_mtime_ns for path in partitions(out)]
    bha.sweep(mapping, out)
    assert [path.stat().st_mtime_ns for path in partitions(out)] == stamps


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"seed": 8}, r"holds another sweep; these differ: spec \(.* there, .* here\). Name another folder"),
        ({"partition_size": 128}, "its partitions have 64 runs, the spec wants 128"),
        (
            {"simulation": {"duration": 0.02, "dt": 0.005, "method": "rk4", "step": 5e-3, "instruction_set": FOREIGN}},
            r"differ: instruction set",
        ),
    ],
)
def test_another_spec_is_refused(tmp_path: Path, changes: dict[str, Any], text: str) -> None:
    bha.sweep(spec(tmp_path, runs=64), tmp_path / "out")
    content = (tmp_path / "out/part-000000.parquet").read_bytes()
    with pytest.raises(bha.InputError, match=text):
        bha.sweep(spec(tmp_path, runs=64, **changes), tmp_path / "out")
    assert (tmp_path / "out/part-000000.parquet").read_bytes() == content


def test_another_computer_goes_on_with_the_same_instruction_set(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path, runs=128), tmp_path / "out"
    scalar = {**mapping, "simulation": {**mapping["simulation"], "instruction_set": "scalar"}}
    bha.sweep(scalar, out)
    whole = bha.sweeps.read(out)
    partitions(out)[1].unlink()
    bha.sweep(mapping, out)
    assert_same(bha.sweeps.read(out), whole)


def test_another_arm_or_version_is_refused(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path, runs=64), tmp_path / "out"
    bha.sweep(mapping, out)
    arm = tmp_path / "arm.toml"
    text = arm.read_text()
    arm.write_text(text.replace("mass = 0.75", "mass = 0.76"))
    with pytest.raises(bha.InputError, match=r"these differ: arm \("):
        bha.sweep(mapping, out)
    arm.write_text(text + "# a remark changes nothing\n")
    bha.sweep(mapping, out)
    manifest = json.loads((out / "sweep.json").read_text())
    manifest["parts"]["package version"] = "0.0.1"
    manifest["fingerprint"] = "0" * 64
    (out / "sweep.json").write_text(json.dumps(manifest))
    with pytest.raises(bha.InputError, match=rf"package version \(0.0.1 there, {bha.__version__} here\)"):
        bha.sweep(mapping, out)


def test_foreign_and_broken_files_are_refused(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path, runs=128), tmp_path / "out"
    bha.sweep(mapping, out)
    bha.sweep(spec(tmp_path, runs=128, seed=8), tmp_path / "other")
    second = out / "part-000001.parquet"
    second.write_bytes((tmp_path / "other/part-000001.parquet").read_bytes())
    with pytest.raises(bha.InputError, match=r"part-000001.parquet: is no partition of this sweep; remove it"):
        bha.sweep(mapping, out)
    second.write_bytes((out / "part-000000.parquet").read_bytes())
    with pytest.raises(bha.InputError, match="is no partition of this sweep"):
        bha.sweep(mapping, out)
    second.unlink()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.tex").touch()
    with pytest.raises(bha.InputError, match=r"holds thesis.tex and no sweep"):
        bha.sweep(mapping, tmp_path / "mine")
    with pytest.raises(bha.InputError, match="is a file; name a folder"):
        bha.sweep(mapping, tmp_path / "mine/thesis.tex")
    with pytest.raises(bha.InputError, match=r"there is no sweep.json"):
        bha.sweeps.read(tmp_path / "mine")
    with pytest.raises(bha.InputError, match="no column 'colour'; allowed: run,"):
        bha.sweeps.read(out, ["colour"])


def test_a_sweep_of_any_size_starts_at_once(tmp_path: Path) -> None:
    """10^12 runs are too many to be listed."""
    out = tmp_path / "out"

    def stop(done: int, runs: int) -> None:
        if done >= 128:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bha.sweep(spec(tmp_path, runs=10**12), out, threads=1, progress=stop)
    assert len(partitions(out)) == 1
    assert bha.sweeps.summarize(out).partitions == 15_625_000_000


def test_one_process_at_a_time(tmp_path: Path) -> None:
    with locked(tmp_path / "out"), pytest.raises(bha.InputError, match="another process is running a sweep there"):
        bha.sweep(spec(tmp_path), tmp_path / "out")


def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = toml(spec(tmp_path, runs=70), tmp_path / "swing.toml")
    done = CliRunner().invoke(main, ["sweep", str(file), "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert (found["folder"], found["done"], found["finished"], found["complete"]) == ("swing", 70, 2, True)
    assert found["metrics"]["peak_rate"]["count"] == 70
    text = CliRunner().invoke(main, ["sweep", str(file)]).output
    assert "70 of 70 runs: 70 ok" in text
    assert "max_tip_displacement" in text
    wrong = CliRunner().invoke(main, ["sweep", str(file), "--threads", "1", "--dask", "tcp://127.0.0.1:1"])
    assert wrong.exit_code == 1
    assert "threads and dask: found both" in wrong.output
    assert os.listdir("swing")
