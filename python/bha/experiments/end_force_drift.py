"""What `end_force` does to energy and stability, beside `work_conjugate`: numbers of ``docs/explanation/model.md``."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from bha import robots
from bha.arm import Arm
from bha.errors import SimulationError
from bha.experiments.figures import drift_figure
from bha.experiments.laboratory import Laboratory
from bha.experiments.measured import with_sections
from bha.experiments.outcome import Claim, Outcome, Table
from bha.parameters import ForceModel
from bha.runs.input import Input
from bha.runs.options import Options
from bha.runs.simulation import Simulation, concatenate
from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]

MODELS: tuple[ForceModel, ForceModel] = ("end_force", "work_conjugate")
#: Section 3 bent by 76 degrees, the others straight.
START = np.array([0.17] * 6 + [0.10, 0.20, 0.20])
#: Gravity in the base frame of the three mountings, m/s^2.
MOUNTINGS = {"lying": (9.81, 0.0, 0.0), "without gravity": (0.0, 0.0, 0.0), "hanging": (0.0, 0.0, 9.81)}
#: Bellows lengths of the random poses, m.
RANGE = (0.12, 0.28)


def run(lab: Laboratory) -> Outcome:
    """Free swing without damping, and the stability of random poses."""
    lab.note("end_force: energy and stability")
    time, energies = free_swing(5.0)
    ratio = {name: values / values[0] for name, values in energies.items()}
    low, high = float(ratio["end_force"].min()), float(ratio["end_force"].max())
    drift = float(np.abs(ratio["work_conjugate"] - 1.0).max())
    counts = {
        mounting: {name: unstable_poses(gravity, name, 200) for name in MODELS}
        for mounting, gravity in MOUNTINGS.items()
    }
    of_end_force = [c["end_force"] for c in counts.values()]
    rows = [[mounting, *(f"{c[name]} of 200" for name in MODELS)] for mounting, c in counts.items()]
    return Outcome(
        "end_force_drift",
        "Force models: energy and stability",
        "The nominal arm without damping, under springs, bending stiffness and gravity only (ambient pressure), "
        "starts with section 3 bent by 76° and swings for 5 s (Runge-Kutta, 0.5 ms). Its energy, counted from that "
        "of rest, must stay what it was. Then, damped as designed, random poses (all bellows between 0.12 and 0.28 "
        "m) are held by the constant pressures that balance them, and the motion linearized about each is checked "
        "for growing modes.",
        [
            Claim(
                "`end_force`: energy between 1 and 5 times its start",
                f"between {low:.2f} and {high:.2f} times",
                0.5 < low < 1.5 and 2.0 < high < 10.0,
            ),
            Claim("`work_conjugate`: energy kept to 2·10⁻⁶", f"kept to {drift:.1e}", drift < 2e-6),
            Claim(
                "`end_force`: 11 of 200 poses unstable lying, 2 without gravity, 0 hanging",
                ", ".join(f"{n} {mounting}" for n, mounting in zip(of_end_force, counts, strict=True)),
                of_end_force[0] > of_end_force[1] >= of_end_force[2],
            ),
            Claim(
                "`work_conjugate`: no pose unstable",
                f"{sum(c['work_conjugate'] for c in counts.values())} of 600",
                all(c["work_conjugate"] == 0 for c in counts.values()),
            ),
        ],
        {
            "end_force_drift": (
                drift_figure(time, ratio),
                "Energy above rest of a free swing without damping, relative to its start.",
            )
        },
        [Table(["mounting", *(f"`{name}`" for name in MODELS)], rows, "Unstable poses.")],
        {"low": low, "high": high, "drift": drift, "unstable_lying": of_end_force[0]},
    )


def free_swing(duration: float) -> tuple[Array, dict[str, Array]]:
    """Times (m,) s and, by force model, energies above rest (m,) J; NaN once the motion has diverged."""
    still = with_sections(robots.load("bha_nominal"), [{"damping": 0.0}] * 3, "undamped")
    ambient = np.full(len(still.inputs), still.parameters.ambient_pressure)
    drive = Input.constant(ambient, duration)
    time = 5e-3 * np.arange(round(duration / 5e-3) + 1, dtype=np.float64)
    energies: dict[str, Array] = {}
    for name in MODELS:
        arm = still.with_changes(force_model=name)
        at_rest = arm.energy(arm.static_lengths(ambient), np.zeros(len(START))).total
        pieces: list[Trajectory] = []
        # The rows until it diverges, if it does.
        with suppress(SimulationError):
            for piece in Simulation(arm, drive, Options(method="rk4", step=5e-4), q0=START).run(time):
                pieces.append(piece)
        motion = concatenate(pieces)
        values = [arm.energy(q, qd).total - at_rest for q, qd in zip(motion.lengths, motion.velocities, strict=True)]
        energies[name] = np.pad(values, (0, len(time) - len(values)), constant_values=np.nan)
    return time, energies


def unstable_poses(gravity: tuple[float, float, float], force_model: ForceModel, count: int, seed: int = 1) -> int:
    """How many of ``count`` random poses of the nominal arm, held by constant pressures, have a growing mode."""
    arm = robots.load("bha_nominal").with_changes(gravity=gravity, force_model=force_model)
    random = np.random.default_rng(seed)
    unstable = 0
    for _ in range(count):
        q = random.uniform(*RANGE, 3 * arm.section_count)
        lacking = np.linalg.solve(arm.actuation_matrix(q), arm.bias_force(q, np.zeros_like(q)))
        growth = growth_rate(arm, q, np.asarray(arm.parameters.ambient_pressure + lacking, dtype=np.float64))
        unstable += growth > 1e-6
    return unstable


def growth_rate(arm: Arm, q: Array, p: Array) -> float:
    """Largest real part of the eigenvalues of the motion about a pose at rest, 1/s; derivatives by differences."""
    n, h = len(q), 1e-6
    zero = np.zeros(n)
    matrix = np.zeros((2 * n, 2 * n))
    matrix[:n, n:] = np.eye(n)
    for k, d in enumerate(h * np.eye(n)):
        matrix[n:, k] = (arm.forward_dynamics(q + d, zero, p) - arm.forward_dynamics(q - d, zero, p)) / (2 * h)
        matrix[n:, n + k] = (arm.forward_dynamics(q, d, p) - arm.forward_dynamics(q, -d, p)) / (2 * h)
    return float(np.linalg.eigvals(matrix).real.max())
