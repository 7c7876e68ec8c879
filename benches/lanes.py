"""Lanes of every instruction set against single simulations, derivatives against pinocchio.

Made so that other work on the machine disturbs the ratios least.

All sides take turns in one process, on one thread; of each the shortest round counts, in processor time (derivatives,
which take microseconds, in time that passes).

    python -m benches.lanes --rounds 10
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

import bha
from bha import _core

from .chain import rigid_chain
from .test_batches import ARM, ARMS, MEMBERS, QD, X0, P, Q

SECONDS = 0.5


def shortest(
    sides: Mapping[str, Callable[[], object]], rounds: int, clock: Callable[[], float], calls: int = 1
) -> dict[str, float]:
    """Seconds of one call of each side: the shortest of some rounds."""
    best = dict.fromkeys(sides, float("inf"))
    for _ in range(rounds):
        for name, side in sides.items():
            begin = clock()
            for _ in range(calls):
                side()
            best[name] = min(best[name], (clock() - begin) / calls)
    return best


def batches(rounds: int) -> None:
    """One line an arm."""
    drives = [bha.Input.constant(p, SECONDS) for p in P]
    print(f"{MEMBERS} trajectories, RK4 at 1 ms, ms of processor time per simulated second")
    for kind, arm in ARMS.items():

        def run(name: str, arm: bha.Arm = arm) -> object:
            options = {"method": "rk4", "step": 1e-3, "threads": 1, "instruction_set": name}
            return bha.simulate_batch(arm, drives, X0, times=np.array([0.0, SECONDS]), **options)

        sides = {name: (lambda name=name, run=run: run(name)) for name in _core.instruction_sets()}
        found = shortest(sides, rounds, time.process_time)
        texts = [f"{name} {1e3 * t / SECONDS:7.1f} ({found['scalar'] / t:4.2f})" for name, t in found.items()]
        print(f"{kind:30s} " + "  ".join(texts), flush=True)


def derivatives(rounds: int) -> None:
    """One line."""
    import pinocchio  # noqa: PLC0415  (only here)

    model, data = rigid_chain(pinocchio)
    sides: dict[str, Callable[[], object]] = {
        "pinocchio.computeABADerivatives": lambda: pinocchio.computeABADerivatives(model, data, Q, QD, QD),
        "bha": lambda: ARM.forward_dynamics_derivatives(Q, QD, P[0]),
    }
    for name in _core.instruction_sets():
        sides[f"of it, {name}"] = partial(_core.Differentiator(ARM, [], name), Q, QD, P[0])
    found = shortest(sides, 200 * rounds, time.perf_counter, 10)
    reference = found["pinocchio.computeABADerivatives"]
    print("derivatives of forward dynamics, µs: " + ", ".join(f"{k} {1e6 * t:.1f}" for k, t in found.items()))
    print(f"bha / pinocchio: {found['bha'] / reference:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=10)
    rounds = parser.parse_args().rounds
    batches(rounds)
    derivatives(rounds)


if __name__ == "__main__":
    main()
