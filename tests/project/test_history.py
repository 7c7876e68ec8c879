"""The benchmarks' history: entries as files, ratios by hand, the page."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

sys.path.insert(0, str(Path(__file__).parents[2]))

from benches.history.__main__ import ENTRIES, main
from benches.history.entry import (
    Entry,
    Machine,
    Row,
    Side,
    file_name,
    from_json,
    ratios,
    read_folder,
    to_json,
)

ROWS = (
    Row("reference against core", "M", (Side("reference", 8e-4, 7e-4, 9e-4), Side("core", 2e-6, 1.75e-6, 2.5e-6))),
    Row("Table III", "full", (Side("reference", 1e-3, 9e-4, 1.1e-3), Side("core", 1e-6, 9e-7, 1.1e-6))),
    Row("Table III", "reduced", (Side("reference", 4e-4, 3.3e-4, 4.5e-4), Side("core", 9e-7, 8e-7, 9.9e-7))),
    Row("in Rust", "forward dynamics", (Side("median", 1.1e-6),)),
)


def entry(commit: str = "a" * 40, committed: str = "2026-11-29T12:00:00Z", processor: str = "Some CPU (R) X1") -> Entry:
    machine = Machine(processor, 2, "Linux x86_64", "3.11.7", "1.95.0")
    return Entry(commit, committed, "2026-11-30T08:00:00Z", 0.25, machine, ROWS)


def test_a_file_gives_back_what_was_written() -> None:
    assert from_json(to_json(entry()), "x.json") == entry()
    assert file_name(entry()) == "2026-11-29_aaaaaaaa_some-cpu-r-x1.json"
    assert "low" not in json.loads(to_json(entry()))["rows"][-1]["sides"][0]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "{}",
        to_json(entry()).replace("bha-bench/1", "bha-bench/2"),
        to_json(entry()).replace('"median"', '"mean"'),
        to_json(entry()).replace('"load"', '"weight"'),
    ],
)
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"x\.json: is no entry of the benchmarks' history: ."):
        read_folder(tmp_path)


def test_ratios() -> None:
    """Sides of a row; rows of Table III to the full model; nothing of one side alone."""
    found = {item.label: item for item in ratios(ROWS)}
    assert {label: item.value for label, item in found.items()} == pytest.approx(
        {
            "reference against core: M, reference / core": 400,
            "Table III: full, reference / core": 1000,
            "Table III: reduced, reference / core": 4000 / 9,
            "Table III: reduced, reference, to full": 0.4,
            "Table III: reduced, core, to full": 0.9,
        }
    )
    widest = found["reference against core: M, reference / core"]
    assert (widest.low, widest.high) == pytest.approx((7e-4 / 2.5e-6, 9e-4 / 1.75e-6))


def test_the_command_prints_and_draws_commits_in_their_order(tmp_path: Path) -> None:
    later = entry("b" * 40, "2026-12-24T12:00:00Z", "Other <b>CPU</b>")
    for item in (later, entry()):
        (tmp_path / file_name(item)).write_text(to_json(item), encoding="utf-8")
    assert [item.commit[0] for item in read_folder(tmp_path)] == ["a", "b"]
    answer = CliRunner().invoke(main, [str(tmp_path), "--out", str(tmp_path / "page" / "x.html")])
    assert answer.exit_code == 0, answer.output
    assert answer.output.index("aaaaaaa") < answer.output.index("bbbbbbb")
    assert "+0 %" in answer.output
    page = (tmp_path / "page" / "x.html").read_text(encoding="utf-8")
    assert page.count('class="plotly-graph-div"') == 5 + 2 * 3
    assert "Other &lt;b&gt;CPU" in page.partition("<h2>Runs</h2>")[2]
    assert "<td>bbbbbbbb</td>" in page


def test_an_empty_folder_says_what_fills_it(tmp_path: Path) -> None:
    answer = CliRunner().invoke(main, [str(tmp_path)])
    assert answer.exit_code == 1
    assert "`make bench` writes one" in answer.output


def test_entries_that_are_kept_can_be_read() -> None:
    """Each under the name that a run of its commit and machine gives it."""
    names = sorted(path.name for path in ENTRIES.glob("*.json"))
    assert sorted(map(file_name, read_folder(ENTRIES))) == names
