"""Metrics against closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import bha
import bha.sweeps
from bha.sweeps.metrics import Runs, evaluate
from bha.sweeps.summary import RunningMoments

from .small_sweeps import one_section, rows, spec


def runs(tips: list[np.ndarray], dt: float, band: float = 0.05, **arrays: Any) -> Runs:
    """Made-up runs whose tip moves along x; shorter ones end in NaN."""
    longest = max(map(len, tips))
    tip = np.full((len(tips), longest, 3), np.nan)
    time = np.full((len(tips), longest), np.nan)
    for k, x in enumerate(tips):
        tip[k, : len(x)] = np.outer(x, [1.0, 0.0, 0.0]) + np.array([0.0, 0.2, 0.3])
        time[k, : len(x)] = dt * np.arange(len(x))
    nothing = np.zeros((len(tips), longest, 3))
    last = np.array([len(x) - 1 for x in tips])
    arm = one_section()
    return Runs(
        time, arrays.get("lengths", nothing), arrays.get("velocities", nothing), tip, last, [arm] * len(tips), band
    )


def test_settling_time_of_a_decay() -> None:
    """x = 1 - e^(-t / T) enters a band of 5 per cent at T ln 20; so does the shorter run; one that swings has not."""
    dt, constant = 1e-3, 0.1
    t = np.arange(0.0, 2.0, dt)
    decay = 1.0 - np.exp(-t / constant)
    found = evaluate(["settling_time"], runs([decay, decay[:1500], np.sin(5 * t), 0 * t], dt))["settling_time"]
    np.testing.assert_allclose(found[:2], constant * np.log(20.0), atol=1e-5)
    assert np.isnan(found[2])
    assert found[3] == 0.0


def test_tip_metrics_of_a_triangle() -> None:
    """Out by 2 m in 1 s and back by 1 m in 1 s, a row every 0.1 s; the second run ends on its way out."""
    x = np.concatenate([np.linspace(0.0, 2.0, 11), np.linspace(1.9, 1.0, 10)])
    found = evaluate(
        ["final_tip_x", "final_tip_displacement", "max_tip_displacement", "rms_tip_displacement", "tip_path_length",
         "peak_tip_speed"],
        runs([x, x[:6]], 0.1),
    )  # fmt: skip
    np.testing.assert_allclose(found["final_tip_x"], [1.0, 1.0])
    np.testing.assert_allclose(found["final_tip_displacement"], [1.0, 1.0])
    np.testing.assert_allclose(found["max_tip_displacement"], [2.0, 1.0])
    np.testing.assert_allclose(found["rms_tip_displacement"], [np.sqrt(np.mean(x**2)), np.sqrt(np.mean(x[:6] ** 2))])
    np.testing.assert_allclose(found["tip_path_length"], [3.0, 1.0])
    np.testing.assert_allclose(found["peak_tip_speed"], [2.0, 2.0])


def test_length_and_energy_metrics(tmp_path: Path) -> None:
    """Of one run, from its trajectory; without damping and pressure the energy stays what it was."""
    names = ["initial_energy", "final_energy", "peak_kinetic_energy", "min_length", "max_length", "peak_rate"]
    names += ["final_tip_x", "final_tip_y", "final_tip_z"]
    initial = {"lengths": [0.14, 0.16, 0.15], "velocities": [0.1, 0.0, -0.1]}
    vary = [{"what": "section.1.damping", "values": [0.0]}]
    options = {"duration": 0.2, "dt": 0.01, "rtol": 1e-9, "atol": 1e-11}
    # Only this force model has an energy whose derivative the bellows' forces are.
    conservative = one_section().with_changes(force_model="work_conjugate")
    conservative.save(tmp_path / "arm.toml")
    mapping = spec(
        tmp_path, kind="grid", runs=None, seed=None, metrics=names, vary=vary, initial=initial, simulation=options,
        input={"pressures": [101_325.0] * 3},
    )  # fmt: skip
    bha.sweep(mapping, tmp_path / "out")
    found = {name: values[0] for name, values in rows(tmp_path / "out").items()}
    base = conservative.parameters.to_mapping()
    base["section"][0]["damping"] = 0.0
    arm = bha.Arm(conservative.parameters.updated(base))
    run = bha.simulate(
        arm, bha.Input.constant([101_325.0] * 3, 0.2), dt=0.01, q0=initial["lengths"], qd0=initial["velocities"],
        options=bha.Options(rtol=1e-9, atol=1e-11),
    )  # fmt: skip
    energies = [arm.energy(q, qd) for q, qd in zip(run.lengths, run.velocities, strict=True)]
    np.testing.assert_allclose(found["initial_energy"], energies[0].total, rtol=1e-12)
    np.testing.assert_allclose(found["final_energy"], found["initial_energy"], rtol=1e-6)
    np.testing.assert_allclose(found["peak_kinetic_energy"], max(e.kinetic for e in energies), rtol=1e-6)
    np.testing.assert_allclose(found["min_length"], run.lengths.min(), rtol=1e-9)
    np.testing.assert_allclose(found["max_length"], run.lengths.max(), rtol=1e-9)
    np.testing.assert_allclose(found["peak_rate"], np.abs(run.velocities).max(), rtol=1e-7)
    tip = [found[f"final_tip_{axis}"] for axis in "xyz"]
    np.testing.assert_allclose(tip, run.head_positions[-1, -1], atol=1e-9)


def test_moments_are_those_of_numpy() -> None:
    values = np.random.default_rng(0).normal(1e6, 1.0, 1000)
    values[::7] = np.nan
    moments = RunningMoments()
    for piece in np.array_split(values, 13):
        moments.add(piece)
    good = values[np.isfinite(values)]
    assert moments.count == len(good)
    np.testing.assert_allclose(moments.mean, good.mean(), rtol=1e-14)
    np.testing.assert_allclose(moments.standard_deviation, good.std(ddof=1), rtol=1e-9)
    assert (moments.low, moments.high) == (good.min(), good.max())
    assert np.isnan(RunningMoments().standard_deviation)


def test_every_metric_has_words() -> None:
    for name, metric in bha.sweeps.METRICS.items():
        assert metric.unit in ("m", "m/s", "s", "J"), name
        assert metric.meaning
