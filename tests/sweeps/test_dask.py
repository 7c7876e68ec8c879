"""The same sweep on a Dask cluster: a scheduler and two workers in processes of their own, one killed in the middle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import bha
import bha.sweeps

from .small_sweeps import assert_same, slow

pytest.importorskip("pyarrow")
pytest.importorskip("distributed")


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address of a scheduler, and the processes: scheduler, workers; nobody starts another one in their place."""
    file = folder / "scheduler.json"
    local = ["--host", "127.0.0.1"]
    quiet = {**os.environ, "DASK_LOGGING__DISTRIBUTED": "critical", "OMP_NUM_THREADS": "1"}

    def launch(*arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments, "--scheduler-file", str(file), *local, "--no-dashboard"],
            env=quiet, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    processes = [launch("scheduler", "--port", "0")]
    processes += [launch("worker", "--nthreads", "1", "--no-nanny") for _ in range(workers)]
    try:
        deadline = time.monotonic() + 60.0
        while not (file.exists() and file.read_text().strip()):
            assert time.monotonic() < deadline, "the scheduler did not start"
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], processes
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


def wait_for_workers(address: str, count: int) -> None:
    import distributed  # noqa: PLC0415  (an optional extra)

    with distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=60)


@pytest.mark.filterwarnings("ignore")  # what distributed warns of is not ours to mend
def test_killed_workers_and_schedulers_lose_and_double_nothing(tmp_path: Path) -> None:
    mapping, out = slow(tmp_path, 8, 0.25), tmp_path / "out"
    counts: list[int] = []
    with cluster(tmp_path, 2) as (address, processes):
        wait_for_workers(address, 2)

        def kill_one(done: int, runs: int) -> None:
            counts.append(done)
            if len(counts) == 3:  # two partitions are done, both workers have more to do
                processes[1].kill()

        summary = bha.sweep(mapping, out, dask=address, progress=kill_one)
        assert processes[1].wait() == -9

        def kill_scheduler(done: int, runs: int) -> None:
            if done:
                processes[0].kill()

        with pytest.raises(bha.InputError, match="the Dask scheduler was lost"):
            bha.sweep(mapping, tmp_path / "here", dask=address, progress=kill_scheduler)
    assert summary.complete
    assert counts == sorted(set(counts))
    assert counts[-1] == summary.done == 64 * 8 - 10
    assert bha.sweeps.read(out).column("run").to_pylist() == list(range(502))
    bha.sweep(mapping, tmp_path / "here", threads=1)
    assert_same(bha.sweeps.read(out), bha.sweeps.read(tmp_path / "here"))


@pytest.mark.filterwarnings("ignore")
def test_no_scheduler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bha.sweeps.cluster._TIMEOUT", "1s")
    with pytest.raises(bha.InputError, match=r"no Dask scheduler answers at tcp://127.0.0.1:1: .*dask scheduler"):
        bha.sweep(slow(tmp_path, 1), tmp_path / "out", dask="tcp://127.0.0.1:1")
