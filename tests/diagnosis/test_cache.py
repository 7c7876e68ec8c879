"""What a diagnosis keeps on disk: damaged files count as not there, and nothing of others is ever touched."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bha
from bha.diagnosis.cache import FOLDER, MARKER, Cache, cache_folder

from .synthetic import make_logs, one_section

KEY, OTHER = "a" * 24, "b" * 24
SHAPES = {"x": (5,), "states": (2, 6)}


def stored(folder: Path, key: str = KEY) -> Path:
    """A cache with one entry; its file."""
    Cache(folder, key).put("plain", x=np.arange(5.0), states=np.ones((2, 6)))
    (file,) = folder.glob(f"{key}-*")
    return file


def tree(folder: Path) -> dict[str, bytes | str]:
    """Every file below a folder with its content, links by where they point."""
    found: dict[str, bytes | str] = {}
    for root, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(root, name)
            text = os.readlink(path) if path.is_symlink() else path.read_bytes() if path.is_file() else "folder"
            found[str(path.relative_to(folder))] = text
    return found


def home(folder: Path) -> Path:
    """What stands in a home folder and looks like a cache."""
    (folder / ".cache/huggingface").mkdir(parents=True)
    (folder / ".cache/huggingface/model.bin").write_text("weights")
    (folder / ".cache" / KEY).mkdir()
    (folder / ".cache" / KEY / f"{'c' * 32}.npz").write_text("of an old version")
    (folder / ".cache/note.txt").write_text("note")
    (folder / "thesis").mkdir()
    (folder / "thesis/.cache").symlink_to(folder / ".cache")
    return folder


def test_what_is_stored_comes_back(tmp_path: Path) -> None:
    stored(tmp_path)
    found = Cache(tmp_path, KEY).get("plain", SHAPES)
    assert found is not None
    np.testing.assert_array_equal(found["x"], np.arange(5.0))
    np.testing.assert_array_equal(found["states"], np.ones((2, 6)))
    assert Cache(tmp_path, KEY).get("rough", SHAPES) is None
    assert Cache(None, KEY).get("plain", SHAPES) is None


def test_other_shapes_and_numbers_that_are_not_finite_count_as_not_there(tmp_path: Path) -> None:
    stored(tmp_path)
    cache = Cache(tmp_path, KEY)
    assert cache.get("plain", {"x": (6,)}) is None
    cache.put("plain", x=np.array([1.0, np.nan]))
    assert cache.get("plain", {"x": (2,)}) is None
    cache.put("plain", x=np.array([1, 2]))
    assert cache.get("plain", {"x": (2,)}) is None


@settings(max_examples=60, deadline=None, derandomize=True)
@given(data=st.data())
def test_any_damage_counts_as_not_there_and_is_said(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("cache")
    file = stored(folder)
    content = bytearray(file.read_bytes())
    kind = data.draw(st.sampled_from(["flip", "cut", "longer", "text", "array", "swap"]))
    place = data.draw(st.integers(0, len(content) - 1))
    if kind == "flip":
        content[place] ^= 1 << data.draw(st.integers(0, 7))
    elif kind == "cut":
        del content[place:]
    elif kind == "longer":
        content += data.draw(st.binary(min_size=1, max_size=9))
    elif kind == "text":
        content = bytearray(data.draw(st.binary(max_size=300)))
    elif kind == "array":
        stream = io.BytesIO()
        np.save(stream, np.ones(3))
        content = bytearray(stream.getvalue())
    else:  # the whole file of another entry
        other = Cache(folder, KEY)
        other.put("rough", x=np.zeros(5), states=np.zeros((2, 6)))
        content = bytearray(next(p for p in folder.glob(f"{KEY}-*") if p != file).read_bytes())
    file.write_bytes(bytes(content))
    with pytest.warns(bha.FileWarning, match=r"is damaged .* computed again") as said:
        assert Cache(folder, KEY).get("plain", SHAPES) is None
    assert str(file) in str(said[0].message)
    assert "\n" not in str(said[0].message)


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path) -> None:
    cache = Cache(tmp_path / "gone", KEY)
    with pytest.warns(bha.FileWarning, match="if interrupted, the diagnosis begins anew"):
        cache.put("plain", x=np.ones(5))


def test_only_own_files_are_removed_one_by_one(tmp_path: Path) -> None:
    with cache_folder(tmp_path) as folder:
        old = stored(folder, OTHER)
        (folder / "mine.txt").write_text("of the user")
        (folder / "mine").mkdir()
        (folder / "mine/deep.npz").write_text("of the user")
        outside = tmp_path / "outside.txt"
        outside.write_text("elsewhere")
        link = folder / f"{OTHER}-{'d' * 32}.arrays"
        link.symlink_to(outside)
        cache = Cache(folder, KEY)
        assert not old.exists()
        stored(folder)
        cache.clear()
    left = {"mine.txt", "mine", link.name, MARKER, "lock"}
    assert {path.name for path in folder.iterdir()} == left
    assert outside.read_text() == "elsewhere"


def test_a_finished_diagnosis_leaves_no_folder_and_an_unfinished_one_what_it_has(tmp_path: Path) -> None:
    with cache_folder(tmp_path) as folder:
        stored(folder)
    assert (tmp_path / FOLDER).is_dir()
    with cache_folder(tmp_path) as folder:
        assert Cache(folder, KEY).get("plain", SHAPES) is not None
        Cache(folder, KEY).clear()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["link", "dangling", "file", "foreign", "link to marked"])
def test_what_others_have_under_that_name_is_refused_untouched(tmp_path: Path, kind: str) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    out.mkdir()
    elsewhere.mkdir()
    (elsewhere / f"{OTHER}-{'d' * 32}.arrays").write_text("looks like one of ours")
    if kind == "link to marked":
        (elsewhere / MARKER).write_text("marked")
    if kind in ("link", "link to marked"):
        (out / FOLDER).symlink_to(elsewhere)
    elif kind == "dangling":
        (out / FOLDER).symlink_to(tmp_path / "nowhere")
    elif kind == "file":
        (out / FOLDER).write_text("a file")
    else:
        (out / FOLDER).mkdir()
        (out / FOLDER / "thesis.tex").write_text("of the user")
    before = tree(tmp_path)
    with pytest.raises(bha.InputError, match=r"move it away, or name another folder"), cache_folder(out):
        pytest.fail("was let in")
    assert tree(tmp_path) == before


@pytest.mark.parametrize("kind", ["home", "link"])
@pytest.mark.parametrize("end", ["finished", "interrupted", "failed"])
def test_a_diagnosis_leaves_all_else_in_the_folder_as_it_is(tmp_path: Path, kind: str, end: str) -> None:
    """``--out ~``: with old caches in it, and however it ends."""
    place = home(tmp_path / "home")
    out = place
    if kind == "link":
        out = tmp_path / "link"
        out.symlink_to(place)
    before = tree(place)
    logs = make_logs(one_section(), [], seed=5, durations=(2.0, 2.0, 2.0))

    def stop(stage: str, share: float | None) -> None:
        if stage.startswith("screening"):
            raise KeyboardInterrupt if end == "interrupted" else bha.SimulationError("made up")

    progress = None if end == "finished" else stop
    try:
        found = bha.diagnose(
            one_section(), logs[:2], logs[2:], kinds=("weak_bellows",), out=out, report=False, progress=progress
        )
        assert end != "failed"
        assert found.complete == (end == "finished")
    except bha.SimulationError:
        assert end == "failed"
    after = tree(place)
    assert {name: after.get(name) for name in before} == before
    new = {name for name in after if name not in before and name.partition("/")[0] != FOLDER}
    assert new == (set() if end == "failed" else {"diagnosis.json", "arm_diagnosed.toml"})
    assert (place / FOLDER).exists() == (end != "finished")


HOLDER = """
import sys, time
from pathlib import Path
from bha.diagnosis.cache import cache_folder
with cache_folder(Path(sys.argv[1])):
    print("in", flush=True)
    time.sleep(60)
"""


def test_one_diagnosis_at_a_time_and_a_killed_one_does_not_block(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process:
        assert process.stdout.readline() == "in\n"
        text = rf"another process is running a diagnosis there \(process {process.pid} on .*since"
        with pytest.raises(bha.InputError, match=text), cache_folder(tmp_path):
            pytest.fail("was let in")
        process.kill()
        process.wait()
        with warnings.catch_warnings(), cache_folder(tmp_path) as folder:
            assert (folder / MARKER).is_file()


@pytest.mark.parametrize("name", ["report.html", "arm_diagnosed.toml", "diagnosis.json"])
def test_files_of_others_are_not_written_over(tmp_path: Path, name: str) -> None:
    pytest.importorskip("plotly")
    (tmp_path / name).write_text("<title>My thesis</title>")
    logs = make_logs(one_section(), [], seed=5, durations=(2.0, 2.0))
    with pytest.raises(bha.InputError, match=rf"{name}: was not written by bha diagnose; move it away"):
        bha.diagnose(one_section(), logs, out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "<title>My thesis</title>"


def test_results_of_an_earlier_diagnosis_are_replaced(tmp_path: Path) -> None:
    pytest.importorskip("plotly")
    logs = make_logs(one_section(), [], seed=5, durations=(2.0, 2.0, 2.0))
    for seed in (0, 1):
        bha.diagnose(one_section(), logs[:2], logs[2:], kinds=("weak_bellows",), out=tmp_path, seed=seed)
        assert {path.name for path in tmp_path.iterdir()} == {"report.html", "arm_diagnosed.toml", "diagnosis.json"}
