"""Table III: relative computing time of the models, of the NumPy reference and of the core."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bha import reference
from bha.arm import Arm
from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome, Table
from bha.simulation.single import simulate

Array = NDArray[np.float64]

#: Label, rotational energy, Coriolis forces.
DYNAMIC = (
    ("full", True, True),
    ("without rotational energy (58), (59)", False, True),
    ("without Coriolis forces (61)", True, False),
    ("without both: reduced", False, False),
)
COUPLED, DECOUPLED = "static coupled (62)", "static decoupled"
#: The paper's values, where they can be read.
PAPER = {"full": "1", "without both: reduced": "0.175", COUPLED: "longer than dynamic", DECOUPLED: "0.014"}
#: Evaluations of the equations of motion for each millisecond: the Runge-Kutta method of fourth order.
EVALUATIONS = 4


def run(lab: Laboratory) -> Outcome:
    """Time the models on the tilt of Fig. 12, per millisecond of motion."""
    lab.note("timing the models")
    of_reference = reference_times(lab.identified, *_states(lab, 20))
    of_core = core_times(lab, rounds=10)
    rows = []
    for label in (*(name for name, _, _ in DYNAMIC), COUPLED, DECOUPLED):
        values = [f"{t[label] / t['full']:.3f}" for t in (of_reference, of_core)]
        rows.append(
            [label, PAPER.get(label, ""), *values, f"{1e3 * of_reference[label]:.2f}", f"{1e6 * of_core[label]:.1f}"]
        )
    reduced = {name: t["without both: reduced"] / t["full"] for name, t in (("ref", of_reference), ("core", of_core))}
    static = of_reference[COUPLED] / of_reference["full"]
    return Outcome(
        "table3",
        "Table III: computing time",
        "Time for one millisecond of the motion of Fig. 12, relative to the full model: four evaluations of the "
        "equations of motion for the dynamic models (Runge-Kutta, 1 ms), one solution for the static ones, started "
        "from the solution of the millisecond before. The reference evaluates the paper's formulas as they stand, "
        "in NumPy; the core computes accelerations by recursion and never forms the Coriolis matrix, so there is "
        "little to be saved by leaving it out. Processor time on the machine that wrote this document: numbers vary "
        "from run to run.",
        [
            Claim(
                "the computation time of the reduced model decreases by about 80 %",
                f"by {100 * (1 - reduced['ref']):.0f} % in the reference, by {100 * (1 - reduced['core']):.0f} % in "
                "the core",
                reduced["ref"] < 0.4,
            ),
            Claim(
                "solving the static coupled model takes even longer than the dynamic simulation",
                f"{static:.1f} times the full model's time in the reference, "
                f"{of_core[COUPLED] / of_core['full']:.1f} times in the core",
                static > 1,
            ),
            Claim(
                "(ours) the core makes the full model cheap",
                f"full model {of_reference['full'] / of_core['full']:.0f} times as fast as the reference, "
                f"{1e-3 / of_core['full']:.0f} times real time",
                of_core["full"] < 1e-3,
            ),
        ],
        tables=[
            Table(
                ["model", "paper", "reference", "core", "reference [ms]", "core [µs]"],
                rows,
                "Computing time relative to the full model, and for a millisecond of motion. Empty: not legible in the "
                "text available to us.",
            )
        ],
        numbers={"reference_reduced": reduced["ref"], "core_reduced": reduced["core"], "reference_static": static},
    )


def reference_times(arm: Arm, states: Sequence[tuple[Array, Array, Array]], pressures: Array) -> dict[str, float]:
    """Seconds per millisecond of motion with the NumPy reference."""
    base = reference.parse_arm(arm.parameters.to_toml())
    calls: dict[str, list[Callable[[], object]]] = {}
    for label, rotational, coriolis in DYNAMIC:
        model = base.with_options(rotational_energy=rotational, coriolis_forces=coriolis)
        calls[label] = [partial(reference.forward_dynamics, model, *state) for state in states]
    solved = [reference.static_lengths(base, pressures[0])]
    for p in pressures[1:]:
        solved.append(reference.static_lengths(base, p, q_start=solved[-1]))
    calls[COUPLED] = [
        partial(reference.static_lengths, base, p, q_start=q) for q, p in zip(solved, pressures[1:], strict=False)
    ]
    calls[DECOUPLED] = [partial(reference.decoupled_static_lengths, base, p) for p in pressures]
    found = shortest(calls, rounds=5)
    return {k: t * (EVALUATIONS if k not in (COUPLED, DECOUPLED) else 1) for k, t in found.items()}


def core_times(lab: Laboratory, rounds: int) -> dict[str, float]:
    """Seconds per millisecond of motion with the core."""
    log = lab.tilt
    arm = lab.identified
    milliseconds = 1e3 * (log.time[-1] - log.time[0])
    start = arm.static_lengths(log.pressures(arm.inputs)[0])
    whole: dict[str, list[Callable[[], object]]] = {}
    for label, rotational, coriolis in DYNAMIC:
        model = arm.with_changes(rotational_energy=rotational, coriolis_forces=coriolis)
        whole[label] = [partial(simulate, model, log, method="rk4", step=1e-3, q0=start)]
    out = {label: t / milliseconds for label, t in shortest(whole, rounds).items()}
    pressures = log.pressures(arm.inputs)[1000:1400]
    solved = [arm.static_lengths(pressures[0])]
    for p in pressures[1:]:
        solved.append(arm.static_lengths(p, start=solved[-1]))
    static: dict[str, list[Callable[[], object]]] = {
        COUPLED: [partial(arm.static_lengths, p, start=q) for q, p in zip(solved, pressures[1:], strict=False)],
        DECOUPLED: [partial(arm.static_lengths, p, coupled=False) for p in pressures],
    }
    return out | shortest(static, rounds)


def _states(lab: Laboratory, count: int) -> tuple[list[tuple[Array, Array, Array]], Array]:
    """States along the tilt, and pressures of consecutive milliseconds while it moves."""
    run = simulate(lab.identified, lab.tilt)
    rows = np.linspace(1000, len(run) - 1, count).astype(int)
    return [(run.lengths[k], run.velocities[k], run.pressures[k]) for k in rows], run.pressures[1100 : 1100 + count]


def shortest(calls: Mapping[str, Sequence[Callable[[], object]]], rounds: int) -> dict[str, float]:
    """Seconds of the processor a call, the mean over each label's calls of the shortest of ``rounds`` times.

    The labels take turns, and other work on the machine can only lengthen a time: the ratios suffer least from it.
    """
    best = {label: np.full(len(of_label), np.inf) for label, of_label in calls.items()}
    for each in range(rounds + 1):
        for label, of_label in calls.items():
            for k, call in enumerate(of_label):
                before = time.process_time()
                call()
                if each:  # the first round fills caches
                    best[label][k] = min(best[label][k], time.process_time() - before)
    return {label: float(times.mean()) for label, times in best.items()}
