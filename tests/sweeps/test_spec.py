"""Sweep files: what is wrong in one is said with file, line, key, found and allowed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
import bha.sweeps

from .small_sweeps import spec, toml, write_log

MASS = {"what": "section.1.mass", "distribution": "uniform", "low": 0.5, "high": 1.0}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"colour": 1}, "colour: unknown key; allowed: schema"),
        ({"schema": "bha-sweep/9"}, 'schema: found "bha-sweep/9"; allowed: "bha-sweep/1"'),
        ({"schema": None}, 'schema: missing; a sweep file begins with: schema = "bha-sweep/1"'),
        ({"kind": "latin"}, 'kind: found "latin"; allowed: "monte_carlo" or "grid"'),
        ({"runs": 0}, "runs: found 0; allowed: a whole number >= 1"),
        ({"runs": 2.5}, "runs: found 2.5; allowed: a whole number >= 1"),
        ({"runs": None}, "runs: missing"),
        ({"seed": -1}, "seed: found -1; allowed: a whole number from 0"),
        ({"partition_size": 100}, "partition_size: found 100; allowed: a multiple of 64"),
        ({"metrics": ["peak_rat"]}, "metrics: found \"peak_rat\"; nearest allowed: 'peak_rate'"),
        ({"metrics": ["peak_rate", "peak_rate"]}, 'metrics: found "peak_rate" twice'),
        ({"metrics": []}, r"metrics: found \[\]; allowed: a list of"),
        ({"settling_band": 1.5}, "settling_band: found 1.5; allowed: a number between 0 and 1"),
        ({"vary": None}, "vary: missing"),
        ({"vary": [{**MASS, "hihg": 1.0}]}, "vary 1: hihg: unknown key; nearest allowed: 'high'"),
        ({"vary": [{**MASS, "low": 2.0}]}, "vary 1: low: found 2.0 and high = 1.0; allowed: low below high"),
        ({"vary": [{**MASS, "mean": 2.0}]}, 'vary 1: mean: does not belong to distribution "uniform"'),
        ({"vary": [{**MASS, "high": None}]}, 'vary 1: high: missing; needed with distribution "uniform"'),
        ({"vary": [{**MASS, "distribution": None}]}, "vary 1: distribution: missing"),
        ({"vary": [{**MASS, "distribution": "gauss"}]}, 'vary 1: distribution: found "gauss"; allowed: "uniform"'),
        ({"vary": [{**MASS, "distribution": "log_uniform", "low": 0.0}]}, "vary 1: low: found 0.0; allowed: .* > 0"),
        ({"vary": [MASS, MASS]}, 'vary 2: what: found "section.1.mass" twice'),
        ({"vary": [{**MASS, "what": "section.2.mass"}]}, 'vary 1: what: found "section.2.mass"; nearest allowed: \'s'),
        ({"vary": [{**MASS, "what": "input.amplitud"}]}, "vary 1: what: .* nearest allowed: 'input.amplitude'"),
        ({"vary": [{**MASS, "what": "initial.offset.q41"}]}, "vary 1: what: .* nearest allowed: 'initial.offset.q1"),
        ({"vary": [{**MASS, "what": "input.offset", "relative": True}]}, "vary 1: relative: found true"),
        ({"vary": [{**MASS, "what": "section.*.mass"}]}, 'vary 1: relative: "section.*.mass" is 1 numbers'),
        ({"vary": [{"what": "input.log", "distribution": "choice"}]}, r"vary 1: what: .* with \[input\] logs only"),
        (
            {
                "vary": [
                    {"what": "section.1.mass", "distribution": "choice", "values": [1.0, 2.0], "weights": [1.0, -1.0]}
                ]
            },
            r"vary 1: weights: found \[1.0, -1.0\]; allowed: a list of numbers >= 0",
        ),
        (
            {"vary": [{"what": "section.1.mass", "distribution": "choice", "values": ["a"]}]},
            r"vary 1: values: found \['a'\]; allowed: numbers",
        ),
        (
            {
                "vary": [
                    {**MASS, "distribution": "normal", "mean": 0.0, "standard_deviation": 1.0, "low": 50, "high": 51}
                ]
            },
            "vary 1: low: low and high leave .* of the distribution",
        ),
        ({"input": {}}, "input: found neither of logs and pressures"),
        ({"input": {"pressures": [1e5, 1e5]}}, "input.pressures: found 2 numbers; allowed: 3"),
        ({"input": {"pressures": [1e5, 1e5, -1.0]}}, r"input.pressures: found .*; allowed: a list of numbers >= 0"),
        ({"input": {"logs": ["none.csv"]}}, "none.csv"),
        ({"input": {"pressures": [1e5] * 3, "log_missing": True}}, "log_missing: found true; allowed: only with logs"),
        ({"input": {"pressures": [1e5] * 3, "log_columns": "m"}}, 'log_columns: found "m"; allowed: only with logs'),
        ({"initial": {"lengths": [0.1, 0.1, 0.1], "pressures": [1e5] * 3}}, "initial: found both"),
        ({"initial": {"lengths": [0.1] * 6}}, "lengths: found 6 numbers; allowed: 3"),
        ({"simulation": {}}, "simulation: duration: missing"),
        ({"simulation": {"duration": 0.1, "dt": 1.0}}, "dt: found 1.0; allowed: at most the duration"),
        ({"simulation": {"duration": 0.1, "method": "euler"}}, 'method: found "euler"; allowed: "auto"'),
        ({"arm": "nobody"}, 'arm: found "nobody"; allowed: a file that exists .*bha_nominal'),
        ({"kind": "grid"}, "runs: a grid has one run for each combination"),
        ({"kind": "grid", "runs": None, "seed": None}, "vary 1: distribution: a grid draws nothing"),
        (
            {"kind": "grid", "runs": None, "seed": None, "vary": [{"what": "section.1.mass", "low": 1.0, "high": 2.0}]},
            "vary 1: count: missing; needed with a range in a grid",
        ),
    ],
)
def test_faults_are_named(tmp_path: Path, changes: dict[str, Any], text: str) -> None:
    mapping = spec(tmp_path, **changes)
    for table in mapping.get("vary", []):
        for key in [key for key, value in table.items() if value is None]:
            del table[key]
    with pytest.raises((bha.ParameterError, bha.LogError)) as caught:
        bha.sweeps.make_plan(mapping)
    assert re.search(text, str(caught.value))


def test_file_and_line_are_named(tmp_path: Path) -> None:
    mapping = spec(tmp_path, vary=[MASS, {**MASS, "what": "section.1.mas"}])
    path = toml(mapping, tmp_path / "mine.toml")
    line = path.read_text().splitlines().index('what = "section.1.mas"') + 1
    with pytest.raises(bha.ParameterError) as caught:
        bha.sweeps.make_plan(path)
    assert str(caught.value).startswith(f"{path}, line {line}: vary 2: what: found")
    path.write_text("schema = ")
    with pytest.raises(bha.ParameterError, match=r"mine\.toml: not a TOML file"):
        bha.sweeps.make_plan(path)
    with pytest.raises(bha.ParameterError, match="there is no such file"):
        bha.sweeps.make_plan(tmp_path / "none.toml")


def test_paths_start_at_the_folder_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_log(tmp_path / "run.csv", 0.1, seed=0)
    mapping = spec(tmp_path, arm="arm.toml", input={"logs": ["run.csv"]}, initial={})
    path = toml(mapping, tmp_path / "mine.toml")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    plan = bha.sweeps.make_plan(path)
    assert plan.arm.name == "one section"
    with pytest.raises(bha.ParameterError, match=r"duration: found 0.2; \"run.csv\" has 0.1 s; allowed: at most that"):
        bha.sweeps.make_plan(toml(mapping | {"simulation": {"duration": 0.2}}, path))


def test_missing_samples_of_a_log_where_they_are_allowed(tmp_path: Path) -> None:
    write_log(tmp_path / "run.csv", 0.1, seed=0)
    lines = (tmp_path / "run.csv").read_text().splitlines()
    with_gap = [f"{line},{'q11 [m]' if k == 0 else '' if k == 2 else '0.2'}" for k, line in enumerate(lines)]
    (tmp_path / "gap.csv").write_text("\n".join(with_gap) + "\n")
    mapping = spec(tmp_path, input={"logs": [str(tmp_path / "gap.csv")]}, initial={})
    with pytest.raises(bha.LogError):
        bha.sweeps.make_plan(mapping)
    allowed = mapping | {"input": {**mapping["input"], "log_missing": True}}
    assert len(bha.sweeps.make_plan(allowed).inputs) == 1
    assert bha.sweeps.SweepSpec.from_mapping(mapping).with_missing().input.log_missing
    with pytest.raises(bha.InputError, match="the sweep has none"):
        bha.sweeps.SweepSpec.from_mapping(spec(tmp_path)).with_missing()


def test_logs_of_another_layout_by_a_mapping_file(tmp_path: Path) -> None:
    write_log(tmp_path / "run.csv", 0.1, seed=0)
    heading, _, rest = (tmp_path / "run.csv").read_text().partition("\n")
    names = [f"channel {k}" for k in range(heading.count(",") + 1)]
    (tmp_path / "other.csv").write_text(f"{','.join(names)}\n{rest}")
    columns = "\n".join(f'"{own}" = "{column}"' for own, column in zip(names, heading.split(","), strict=True))
    (tmp_path / "map.toml").write_text(f'schema = "bha-columns/1"\n[columns]\n{columns}\n')
    mapping = spec(tmp_path, input={"logs": [str(tmp_path / "other.csv")]}, initial={})
    with pytest.raises(bha.LogError):
        bha.sweeps.make_plan(mapping)
    stated = mapping | {"input": {**mapping["input"], "log_columns": str(tmp_path / "map.toml")}}
    (drive,) = bha.sweeps.make_plan(stated).inputs
    right = spec(tmp_path, input={"logs": [str(tmp_path / "run.csv")]}, initial={})
    np.testing.assert_array_equal(drive.pressures, bha.sweeps.make_plan(right).inputs[0].pressures)
    made = bha.sweeps.SweepSpec.from_mapping(mapping).with_columns(tmp_path / "map.toml")
    assert made.input.log_columns == str(tmp_path / "map.toml")
    with pytest.raises(bha.InputError, match="the sweep has none"):
        bha.sweeps.SweepSpec.from_mapping(spec(tmp_path)).with_columns("map.toml")


def test_results_follow_from_the_fingerprint(tmp_path: Path) -> None:
    """What moves a result moves the fingerprint; the size of the partitions does neither."""
    log = tmp_path / "run.csv"
    write_log(log, 0.1, seed=0)

    def fingerprint(**changes: Any) -> str:
        mapping = spec(tmp_path, input={"logs": [str(log)]}, **changes)
        return bha.sweeps.make_plan(mapping).fingerprint

    first = fingerprint()
    assert fingerprint() == first
    assert fingerprint(partition_size=128) == first
    others = [fingerprint(seed=8), fingerprint(runs=201), fingerprint(vary=[MASS]), fingerprint(metrics=["peak_rate"])]
    write_log(log, 0.1, seed=1)
    others.append(fingerprint())
    arm = tmp_path / "arm.toml"
    arm.write_text(arm.read_text().replace("mass = 0.75", "mass = 0.76"))
    others.append(fingerprint())
    assert len({first, *others}) == 7
