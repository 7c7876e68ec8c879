"""Sweeps of a one-section arm, some milliseconds a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import bha
import bha.sweeps
from bha.parameters import ArmParameters

PRESSURES = [1.2e5, 1.1e5, 1.0e5]


def one_section() -> bha.Arm:
    mapping = bha.robots.load("bha_nominal").parameters.to_mapping()
    section = {k: v for k, v in mapping["section"][0].items() if k not in ("provenance", "inertia")}
    plain = {k: v for k, v in mapping.items() if k not in ("provenance", "pneumatics")}
    return bha.Arm(ArmParameters.from_mapping(plain | {"section": [section], "name": "one section"}))


def spec(folder: Path, **changes: Any) -> dict[str, Any]:
    """The mapping of a sweep file, its arm written beside it; ``changes`` replace top-level keys, None removes one."""
    arm = folder / "arm.toml"
    if not arm.exists():
        one_section().save(arm)
    mapping: dict[str, Any] = {
        "schema": "bha-sweep/1",
        "arm": str(arm),
        "kind": "monte_carlo",
        "runs": 200,
        "seed": 7,
        "partition_size": 64,
        "metrics": ["final_tip_displacement", "max_tip_displacement", "peak_rate"],
        "input": {"pressures": PRESSURES},
        "initial": {"pressures": [1.4e5, 1.0e5, 1.0e5]},
        "simulation": {"duration": 0.02, "dt": 0.005, "method": "rk4", "step": 5e-3},
        "vary": [
            {"what": "section.1.mass", "distribution": "normal", "mean": 0.75, "standard_deviation": 0.05},
            {"what": "input.offset.p11", "distribution": "uniform", "low": -1e4, "high": 1e4},
        ],
    }
    mapping |= changes
    return {key: value for key, value in mapping.items() if value is not None}


def toml(mapping: dict[str, Any], path: Path) -> Path:
    import tomlkit  # noqa: PLC0415  (only the tests of the command need it)

    path.write_text(tomlkit.dumps(mapping), encoding="utf-8")
    return path


def rows(out: Path) -> dict[str, Any]:
    """The columns of a sweep's folder as arrays."""
    table = bha.sweeps.read(out)
    return {name: table.column(name).to_numpy() for name in table.column_names}


def assert_same(table: Any, other: Any) -> None:
    """Equal to the last digit; NaN is equal to NaN."""
    assert table.schema.equals(other.schema)
    for name in table.column_names:
        np.testing.assert_array_equal(table.column(name).to_numpy(), other.column(name).to_numpy(), err_msg=name)


def slow(folder: Path, partitions: int, duration: float = 0.4) -> dict[str, Any]:
    """Partitions of a tenth of a second or more, so that one can end a sweep in its middle."""
    return spec(
        folder, runs=64 * partitions - 10, simulation={"duration": duration, "dt": 0.01, "method": "rk4", "step": 1e-3}
    )


def write_log(path: Path, duration: float, seed: int, inputs: int = 3) -> bha.Log:
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration / 0.01) + 1) * 0.01 + 2.0
    pressures = 101_325.0 + rng.uniform(0.0, 5e4, (len(time), inputs))
    log = bha.Log.from_arrays({"t [s]": time, **{f"p1{k + 1} [Pa]": pressures[:, k] for k in range(inputs)}})
    log.write(path)
    return bha.Log.read(path)
