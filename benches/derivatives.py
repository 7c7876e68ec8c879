"""Derivatives of a prediction by differences in lanes and by dual numbers: what each takes, and how far they are apart.

Both at the same fixed step, so that the exact derivative of the same computed outputs is what is wanted.

    python -m benches.derivatives
    python -m benches.derivatives --sections 1 --duration 12
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import bha
from bha.estimation.engine import Model
from bha.estimation.free import default_free, resolve
from bha.estimation.records import windows
from bha.estimation.runs import Integration
from bha.identification import record

from .identify_recovery.logs import Condition, arm_of, synthetic_log

STEP = 5e-3


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sections", type=int, default=3)
    parser.add_argument("--duration", type=float, default=60.0, help="s")
    parser.add_argument("--window", type=float, default=6.0, help="s")
    arguments = parser.parse_args()
    arm = arm_of(arguments.sections)
    log = synthetic_log(arm, Condition("derivatives", rate=200.0, duration=arguments.duration), 0)
    rec = record(arm, log)
    free = default_free(arm.parameters)
    pieces = windows([rec], arguments.window)
    rest = arm.static_lengths(rec.drive.pressures[0])
    states = np.tile(np.concatenate([rest, np.zeros_like(rest)]), (len(pieces), 1))
    model = Model(arm.parameters, resolve(arm.parameters, free), (rec,), Integration(STEP, threads=1))
    zero = np.zeros(len(free))
    model.predict(zero, pieces[:1], states[:1])
    began, wall = time.process_time(), time.perf_counter()
    differences = list(model.linearize(zero, pieces, states))
    lanes = time.process_time() - began, time.perf_counter() - wall

    began, wall = time.process_time(), time.perf_counter()
    exact = []
    for piece, state in zip(pieces, states, strict=True):
        rows = rec.time[piece.first : piece.last]
        options = bha.Options(method="rk4", step=STEP * (1.0 + 1e-9))
        found = bha.sensitivities(arm, rec.drive, state, times=rows, start=rows[0], parameters=free, options=options)
        exact.append(found)
    duals = time.process_time() - began, time.perf_counter() - wall
    apart = []
    for (_, by_z, by_state), found in zip(differences, exact, strict=True):
        n = by_state.shape[2] // 2
        values = [c.slope(0.0) for c in model.coordinates]
        for table, other in ((by_z, found.by_parameters[:, :n] * values), (by_state, found.by_initial_state[:, :n])):
            size = np.sqrt(np.mean(other**2, axis=(0, 1)))
            apart.append(np.sqrt(np.mean((table - other) ** 2, axis=(0, 1))) / np.maximum(size, 1e-300))
    print(f"{len(free)} parameters, {states.shape[1]} numbers of the state, {len(pieces)} windows, {len(rec)} rows")
    print(f"differences in lanes: {lanes[0]:.2f} s of one core ({lanes[1]:.2f} s)")
    print(f"dual numbers:         {duals[0]:.2f} s of one core ({duals[1]:.2f} s)")
    print(f"apart, root mean square over that of the derivative: at most {np.max(np.concatenate(apart)):.1e}")


if __name__ == "__main__":
    main()
