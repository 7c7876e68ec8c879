"""Small synthetic logs from the core itself: one section, some seconds, with or without an effect."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import bha
from bha.estimation.records import Record
from bha.parameters import ArmParameters
from bha.recordings import ChannelFacts, Observation, Output

SAMPLE_TIME = 5e-3


def one_section(scale: dict[str, float] | None = None) -> bha.Arm:
    """The first section of the nominal arm, some of its values scaled."""
    mapping = bha.robots.load("bha_nominal").parameters.to_mapping()
    section = {k: v for k, v in mapping["section"][0].items() if k not in ("provenance", "inertia")}
    for key, factor in (scale or {}).items():
        value = section[key]
        section[key] = [v * factor for v in value] if isinstance(value, list) else value * factor
    mapping = {k: v for k, v in mapping.items() if k != "provenance"} | {"section": [section], "name": "one_section"}
    return bha.Arm(ArmParameters.from_mapping(mapping))


def record_of(
    time: NDArray[np.float64],
    outputs: NDArray[np.float64],
    pressures: NDArray[np.float64],
    noise: float = 1e-4,
    pressure_noise: float = 0.0,
    name: str = "log",
) -> Record:
    """A prepared log of lengths as they are, every row of which counts."""
    facts = tuple(ChannelFacts(f"q1{k + 1}", "m", noise, 0.0, 0.0) for k in range(outputs.shape[1]))
    inputs = tuple(ChannelFacts(f"p1{k + 1}", "Pa", pressure_noise, 0.0, 0.0) for k in range(pressures.shape[1]))
    good = np.ones(outputs.shape, dtype=np.bool_)
    shown = observation(*(fact.name for fact in facts))
    return Record(
        name, bha.Input(time, pressures, commanded=False), np.arange(len(time)), shown, outputs, good, facts, inputs
    )


def observation(*names: str, sections: int = 1) -> Observation:
    """Lengths (``q12``) and head positions (``z1``) of standard bellows as they are."""
    outputs = [
        Output(name, "length", "m", int(name[1]), int(name[2]), "bellows")
        if name.startswith("q")
        else Output(name, "position", "m", int(name[1]), 1 + "xyz".index(name[0]))
        for name in names
    ]
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["section"] = mapping["section"][:sections]
    return Observation.of(ArmParameters.from_mapping(mapping), outputs)


def pressures(time: NDArray[np.float64], kind: str, rng: np.random.Generator, inputs: int = 3) -> NDArray[np.float64]:
    """Steps or a multisine about ambient pressure, Pa, smoothed over some 40 ms."""
    ambient = 101325.0
    if kind == "steps":
        edges = np.arange(0.0, time[-1] + 1.5, 1.3)
        levels = rng.uniform(-1.5e4, 5.5e4, (len(edges), inputs))
        p = levels[np.searchsorted(edges, time, side="right") - 1]
    else:
        lines = np.geomspace(0.15, 5.0, 9)
        p = np.full((len(time), inputs), 2e4)
        for k in range(inputs):
            phases = rng.uniform(0.0, 2.0 * np.pi, len(lines))
            p[:, k] += 9e3 * np.sum(np.sin(2.0 * np.pi * time[:, None] * lines + phases) / lines**0.3, axis=1)
        p = np.clip(p, -2.5e4, 8e4)
    keep = np.exp(-SAMPLE_TIME / 0.02)
    for _ in range(2):
        for row in range(1, len(p)):
            p[row] = p[row - 1] * keep + p[row] * (1.0 - keep)
    return ambient + p


def run_of(
    arm: bha.Arm,
    time: NDArray[np.float64],
    p: NDArray[np.float64],
    effects: list[dict[str, Any]],
    options: bha.Options | None = None,
) -> bha.Trajectory:
    """The arm with effects under the pressures ``p``."""
    tables = [{"kind": e["kind"], "where": e["where"], **e["parameters"]} for e in effects]
    options = options or bha.Options(method="rk4", step=2.5e-3)
    return bha.simulate(arm.with_effects(tables), bha.Input(time, p), times=time, options=options)


def simulated(
    arm: bha.Arm, time: NDArray[np.float64], p: NDArray[np.float64], effects: list[dict[str, Any]]
) -> NDArray[np.float64]:
    """Measured lengths without noise."""
    run = run_of(arm, time, p, effects)
    return np.asarray(run.lengths if run.measured_lengths is None else run.measured_lengths)


def make_logs(
    arm: bha.Arm,
    effects: list[dict[str, Any]],
    *,
    seed: int = 0,
    durations: tuple[float, ...] = (8.0, 6.0, 7.0),
    noise: float = 2e-4,
    pressure_noise: float = 200.0,
    quantum: float = 5e-5,
) -> list[bha.Log]:
    """Logs of the arm with hidden effects, alternately steps and multisines, the last one of both."""
    logs = []
    n = 3 * arm.section_count
    for number, duration in enumerate(durations):
        rng = np.random.default_rng([seed, number])
        time = np.arange(round(duration / SAMPLE_TIME) + 1) * SAMPLE_TIME
        p = pressures(time, "multisine" if number % 2 else "steps", rng, len(arm.inputs))
        q = simulated(arm, time, p, effects) + noise * rng.standard_normal((len(time), n))
        measured = p + pressure_noise * rng.standard_normal(p.shape)
        columns: dict[str, Any] = {"t [s]": time}
        columns |= {f"{name} [Pa]": measured[:, k] for k, name in enumerate(arm.inputs)}
        columns |= {f"q{k // 3 + 1}{k % 3 + 1} [m]": np.round(q[:, k] / quantum) * quantum for k in range(n)}
        logs.append(bha.Log.from_arrays(columns))
    return logs
