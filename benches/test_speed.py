"""Core against reference, against a rigid-body library, and Table III: both sides in one process, medians.

``make bench`` runs this and prints one table of ratios at the end (``conftest.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha import reference as ref
from bha.parameters import ArmParameters

from .chain import rigid_chain

FILE = Path(bha.robots.__file__).with_name("bha_nominal.toml")
CORE = bha.robots.load("bha_nominal")
REFERENCE = ref.load_arm(FILE)

RNG = np.random.default_rng(0)
Q, QD, P = RNG.uniform(0.12, 0.28, 9), RNG.uniform(-0.4, 0.4, 9), RNG.uniform(0.9e5, 1.8e5, 9)

PAIRS: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
    "inertia matrix M": (lambda: ref.inertia_matrix(REFERENCE, Q), lambda: CORE.inertia_matrix(Q)),
    "Coriolis matrix C": (lambda: ref.coriolis_matrix(REFERENCE, Q, QD), lambda: CORE.coriolis_matrix(Q, QD)),
    "bias force N": (lambda: ref.bias_force(REFERENCE, Q, QD), lambda: CORE.bias_force(Q, QD)),
    "actuation force tau": (lambda: ref.actuation_force(REFERENCE, Q, P), lambda: CORE.actuation_force(Q, P)),
    "forward dynamics": (
        lambda: ref.forward_dynamics(REFERENCE, Q, QD, P),
        lambda: CORE.forward_dynamics(Q, QD, P),
    ),
}


@pytest.mark.parametrize("quantity", PAIRS)
@pytest.mark.parametrize("side", ["reference", "core"])
def test_core_against_reference(benchmark: Any, quantity: str, side: str) -> None:
    benchmark.extra_info.update(table="reference against core", row=quantity, side=side)
    benchmark(PAIRS[quantity][side == "core"])


@pytest.mark.parametrize("side", ["reference", "core"])
def test_one_second_of_rk4(benchmark: Any, side: str) -> None:
    """One simulated second at 1 ms; the reference runs a twentieth of it, counted twenty times."""
    benchmark.extra_info.update(table="reference against core", row="1 s, RK4 at 1 ms", side=side)
    q0 = CORE.static_lengths(P)
    if side == "core":
        drive = bha.Input.constant(P, 1.0)
        benchmark(lambda: bha.simulate(CORE, drive, dt=1.0, method="rk4", q0=q0, qd0=QD))
        return
    benchmark.extra_info["times"] = 20
    benchmark.pedantic(lambda: ref.simulate_rk4(REFERENCE, q0, QD, lambda _: P, 1e-3, 50), rounds=5)


@pytest.mark.parametrize("side", ["pinocchio.aba, 9 joints", "bha forward_dynamics, 9 lengths"])
def test_call_from_python(benchmark: Any, side: str) -> None:
    """What a controller in Python pays for one evaluation."""
    benchmark.extra_info.update(table="one call from Python", row="forward dynamics", side=side)
    if side.startswith("bha"):
        benchmark(CORE.forward_dynamics, Q, QD, P)
        return
    pinocchio = pytest.importorskip("pinocchio")
    model, data = rigid_chain(pinocchio)
    benchmark(pinocchio.aba, model, data, Q, QD, QD)


@pytest.mark.parametrize("sections", [3, 30])
def test_sections(benchmark: Any, sections: int) -> None:
    benchmark.extra_info.update(table="sections", row="forward dynamics", side=f"{sections} sections")
    mapping = ArmParameters.read(FILE).to_mapping()
    mapping.pop("provenance", None)
    mapping["section"] = [mapping["section"][k % 3] for k in range(sections)]
    arm = bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))
    q, qd, p = np.tile(Q, sections // 3), np.tile(QD, sections // 3), np.tile(P, sections // 3)
    benchmark(arm.forward_dynamics, q, qd, p)


TABLE_III = {
    "full": {},
    "without rotational energy": {"rotational_energy": False},
    "without Coriolis forces": {"coriolis_forces": False},
    "without both (reduced)": {"rotational_energy": False, "coriolis_forces": False},
}


@pytest.mark.parametrize("side", ["reference", "core"])
@pytest.mark.parametrize("model", TABLE_III)
def test_table_3_dynamic(benchmark: Any, model: str, side: str) -> None:
    benchmark.extra_info.update(table="Table III", row=model, side=side)
    if side == "core":
        benchmark(CORE.with_changes(**TABLE_III[model]).forward_dynamics, Q, QD, P)
    else:
        benchmark(ref.forward_dynamics, REFERENCE.with_options(**TABLE_III[model]), Q, QD, P)


@pytest.mark.parametrize("side", ["reference", "core"])
@pytest.mark.parametrize("model", ["static (coupled)", "static (decoupled)"])
def test_table_3_static(benchmark: Any, model: str, side: str) -> None:
    benchmark.extra_info.update(table="Table III", row=model, side=side)
    coupled = model == "static (coupled)"
    if side == "core":
        benchmark(CORE.static_lengths, P, coupled=coupled)
    else:
        benchmark(ref.static_lengths if coupled else ref.decoupled_static_lengths, REFERENCE, P)
