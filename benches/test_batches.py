"""Lanes against one simulation after the other, derivatives against a rigid-body library: both sides in one process."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha
from bha import _core

from .chain import rigid_chain

ARM = bha.robots.load("bha_nominal")
MATERIAL = (
    {"kind": "creep", "where": "all", "stiffness": 100.0, "tau": 0.5},
    {"kind": "friction", "where": "section 2", "coulomb_force": 0.3},
)
LAG = {"kind": "pressure_lag", "where": "all", "fill": 0.05, "vent": 0.1}
ARMS = {
    "plain arm": ARM,
    "creep, friction": ARM.with_effects(MATERIAL),
    "creep, friction, pressure lag": ARM.with_effects((*MATERIAL, LAG)),
    "full pneumatics": ARM.with_changes(pneumatics="full"),
}
MEMBERS = 64
RNG = np.random.default_rng(0)
P = RNG.uniform(1.1e5, 1.5e5, (MEMBERS, 9))
X0 = np.hstack([RNG.uniform(0.15, 0.25, (MEMBERS, 9)), np.zeros((MEMBERS, 9))])
Q, QD = RNG.uniform(0.12, 0.28, 9), RNG.uniform(-0.4, 0.4, 9)


@pytest.mark.parametrize("side", ["scalar", _core.instruction_sets()[-1]])
@pytest.mark.parametrize("kind", ARMS)
def test_lanes(benchmark: Any, kind: str, side: str) -> None:
    """One thread; the cost of a million trajectories follows: a million medians over the members."""
    row = f"{kind}: 1 s, RK4 at 1 ms, {MEMBERS} trajectories"
    benchmark.extra_info.update(table="one thread, lanes", row=row, side=side)
    drives = [bha.Input.constant(p, 1.0) for p in P]
    times = np.array([0.0, 1.0])
    benchmark.pedantic(
        lambda: bha.simulate_batch(
            ARMS[kind], drives, X0, times=times, method="rk4", step=1e-3, threads=1, instruction_set=side
        ),
        rounds=5,
    )


@pytest.mark.parametrize("side", ["bha, by 27 states and inputs", "pinocchio.computeABADerivatives, 9 joints"])
def test_derivatives(benchmark: Any, side: str) -> None:
    row = "derivatives of forward dynamics"
    benchmark.extra_info.update(table="one call from Python, derivatives", row=row, side=side)
    if side.startswith("bha"):
        benchmark(ARM.forward_dynamics_derivatives, Q, QD, P[0])
        return
    pinocchio = pytest.importorskip("pinocchio")
    model, data = rigid_chain(pinocchio)
    benchmark(pinocchio.computeABADerivatives, model, data, Q, QD, QD)
