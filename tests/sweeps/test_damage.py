"""Damaged files of a sweep: found by their checksums, computed again on going on, an error where they are read."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

import bha
import bha.sweeps
from bha.cli import main

from .small_sweeps import assert_same, spec, toml

parquet = pytest.importorskip("pyarrow.parquet")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """A small sweep of two partitions; tests put back what they change."""
    folder = tmp_path_factory.mktemp("sweep")
    mapping = spec(folder, runs=70)
    bha.sweep(mapping, folder / "out", threads=1)
    return mapping, folder / "out"


@settings(max_examples=80, deadline=None, derandomize=True)
@given(data=st.data())
def test_every_flip_and_cut_of_a_partition_is_found(finished: tuple[dict[str, Any], Path], data: st.DataObject) -> None:
    _, out = finished
    path = out / "part-000001.parquet"
    whole = path.read_bytes()
    content = bytearray(whole)
    kind = data.draw(st.sampled_from(["flip", "flip", "flip", "cut", "longer", "bytes"]))
    place = data.draw(st.integers(0, len(content) - 1))
    if kind == "flip":
        content[place] ^= 1 << data.draw(st.integers(0, 7))
    elif kind == "cut":
        del content[place:]
    elif kind == "longer":
        content += data.draw(st.binary(min_size=1, max_size=9))
    else:
        content = bytearray(data.draw(st.binary(max_size=60)))
    path.write_bytes(bytes(content))
    try:
        for read in (bha.sweeps.read, bha.sweeps.summarize):
            with pytest.raises(bha.InputError, match=r"part-000001\.parquet: is damaged or cut off .* remove the file"):
                read(out)
    finally:
        path.write_bytes(whole)


def test_every_byte_of_the_end_counts(finished: tuple[dict[str, Any], Path]) -> None:
    """The metadata decide how the numbers are read; the checksum itself stands among them."""
    _, out = finished
    path = out / "part-000001.parquet"
    whole = path.read_bytes()
    try:
        for place in range(len(whole) - 300, len(whole)):
            content = bytearray(whole)
            content[place] ^= 4
            path.write_bytes(bytes(content))
            with pytest.raises(bha.InputError, match="is damaged"):
                bha.sweeps.read(out)
    finally:
        path.write_bytes(whole)


def test_other_programs_read_the_partitions(finished: tuple[dict[str, Any], Path]) -> None:
    _, out = finished
    assert parquet.read_table(out / "part-000000.parquet", partitioning=None).num_rows == 64


@pytest.mark.parametrize("kind", ["flip", "cut", "empty"])
def test_damaged_partitions_are_computed_again(tmp_path: Path, kind: str) -> None:
    mapping, out = spec(tmp_path, runs=130), tmp_path / "out"
    bha.sweep(mapping, out)
    whole = bha.sweeps.read(out)
    path = out / "part-000001.parquet"
    content = bytearray(path.read_bytes())
    if kind == "flip":
        content[len(content) // 3] ^= 1
    path.write_bytes(b"" if kind == "empty" else bytes(content[:-20] if kind == "cut" else content))
    others = {p: p.stat().st_mtime_ns for p in out.glob("part-*") if p != path}
    with pytest.warns(bha.FileWarning, match=r"part-000001\.parquet: is damaged .* its runs are computed again"):
        summary = bha.sweep(mapping, out)
    assert summary.complete
    assert_same(bha.sweeps.read(out), whole)
    assert {p: p.stat().st_mtime_ns for p in others} == others


def test_a_damaged_partition_of_another_sweep_is_not_written_over(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path, runs=64), tmp_path / "out"
    bha.sweep(mapping, out)
    bha.sweep(spec(tmp_path, runs=64, seed=8), tmp_path / "other")
    content = bytearray((tmp_path / "other/part-000000.parquet").read_bytes())
    content[40] ^= 1
    (out / "part-000000.parquet").write_bytes(bytes(content))
    with pytest.raises(bha.InputError, match="is no partition of this sweep; remove it"):
        bha.sweep(mapping, out)
    assert (out / "part-000000.parquet").read_bytes() == bytes(content)
    # Nor is it read as one of this sweep.
    (out / "part-000000.parquet").write_bytes((tmp_path / "other/part-000000.parquet").read_bytes())
    with pytest.raises(bha.InputError, match="is no partition of this sweep"):
        bha.sweeps.read(out)


def test_the_command_says_it_in_a_line(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path, runs=64), tmp_path / "out"
    file = toml(mapping, tmp_path / "sweep.toml")
    bha.sweep(mapping, out)
    path = out / "part-000000.parquet"
    path.write_bytes(path.read_bytes()[:-1])
    done = CliRunner().invoke(main, ["sweep", str(file), "--out", str(out), "--json"])
    assert done.exit_code == 0, done.output
    assert done.stderr == (
        f"warning: {path}: is damaged or cut off (its checksum is wrong); its runs are computed again\n"
    )


MANIFESTS = [
    '{"schema":"bha-sweep-run/1"}',
    "[" * 100_000,
    "",
    "[]",
    "nonsense",
    '{"schema":"bha-sweep-run/2"}',
    "\x00\xff",
]


@pytest.mark.parametrize("text", MANIFESTS, ids=range(len(MANIFESTS)))
def test_manifests_that_are_none(tmp_path: Path, text: str) -> None:
    mapping, out = spec(tmp_path, runs=64), tmp_path / "out"
    out.mkdir()
    (out / "sweep.json").write_bytes(text.encode("latin-1"))
    for call in (lambda: bha.sweep(mapping, out), lambda: bha.sweeps.read(out), lambda: bha.sweeps.summarize(out)):
        with pytest.raises(bha.InputError, match=r"sweep\.json: .*remove sweep\.json, and the same sweep goes on"):
            call()


@settings(max_examples=80, deadline=None, derandomize=True)
@given(data=st.data())
def test_damaged_manifests_are_found(finished: tuple[dict[str, Any], Path], data: st.DataObject) -> None:
    _, out = finished
    path = out / "sweep.json"
    whole = path.read_bytes()
    content: Any = json.loads(whole)
    if data.draw(st.booleans()):
        changed = bytearray(whole)
        changed[data.draw(st.integers(0, len(changed) - 1))] ^= 1 << data.draw(st.integers(0, 7))
        path.write_bytes(bytes(changed))
        try:
            same = json.loads(changed) == content  # a space for a tab
        except ValueError:
            same = False
    else:
        place, key = content, data.draw(st.sampled_from(sorted(content)))
        if isinstance(content[key], dict) and data.draw(st.booleans()):
            place, key = content[key], data.draw(st.sampled_from(sorted(content[key])))
        value = (
            st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just([]) | st.just({})
        )
        new = data.draw(value | st.just("remove"))
        same = place[key] == new and type(place[key]) is type(new)
        if new == "remove":
            del place[key]
        else:
            place[key] = new
        path.write_text(json.dumps(content))
    try:
        if not same:
            for read in (bha.sweeps.read, bha.sweeps.summarize):
                with pytest.raises(bha.InputError, match=r"sweep\.json"):
                    read(out)
    finally:
        path.write_bytes(whole)


def test_a_damaged_manifest_is_written_again_by_the_same_sweep(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path, runs=64), tmp_path / "out"
    bha.sweep(mapping, out)
    path = out / "sweep.json"
    whole = path.read_text()
    path.write_text(whole.replace('"unit": "m"', '"unit": "l"'))
    with pytest.raises(bha.InputError, match=r"sweep\.json: is damaged \(its checksum is wrong\); remove sweep\.json"):
        bha.sweeps.summarize(out)
    with pytest.warns(bha.FileWarning, match="it is written again"):
        bha.sweep(mapping, out)
    assert path.read_text() == whole
    # What the error advises: nothing is computed again.
    path.unlink()
    stamp = (out / "part-000000.parquet").stat().st_mtime_ns
    bha.sweep(mapping, out)
    assert path.read_text() == whole
    assert (out / "part-000000.parquet").stat().st_mtime_ns == stamp


def test_a_folder_with_other_things_stays_as_it_is(tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / ".lock").write_text("of another program")
    (mine / "thesis.tex").touch()
    with pytest.raises(bha.InputError, match=r"holds thesis\.tex and no sweep"):
        bha.sweep(spec(tmp_path, runs=64), mine)
    assert (mine / ".lock").read_text() == "of another program"
    with pytest.raises(bha.InputError, match="lies below a file; name a folder"):
        bha.sweep(spec(tmp_path, runs=64), mine / "thesis.tex/x")
    with pytest.raises(bha.FileError, match="use a shorter name"):
        bha.sweep(spec(tmp_path, runs=64), tmp_path / ("x" * 300))


HOLDER = """
import sys, time
from pathlib import Path
from bha.sweeps.folder import locked
with locked(Path(sys.argv[1])):
    print("in", flush=True)
    time.sleep(60)
"""


def test_the_other_process_is_named_and_a_killed_one_does_not_block(tmp_path: Path) -> None:
    mapping, out = spec(tmp_path, runs=64), tmp_path / "out"
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(out)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process:
        assert process.stdout.readline() == "in\n"
        with pytest.raises(bha.InputError, match=rf"running a sweep there \(process {process.pid} on .*, since "):
            bha.sweep(mapping, out)
        process.kill()
        process.wait()
        assert bha.sweep(mapping, out).complete


def test_an_address_that_is_none_is_refused_at_once(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    for address in ("not an address", "", "tcp://host", "host:port", "tcp://:8786", "gopher://host:1"):
        with pytest.raises(bha.InputError, match=r"allowed: the address of a scheduler, as in tcp://host:8786"):
            bha.sweep(spec(tmp_path, runs=64), tmp_path / "out", dask=address)
