"""Against soromox (JAX, piecewise constant strain): three segments, nine degrees of freedom, float64, jit and vmap.

Both sides in one process on the same cores, all of them: the CPU backend of JAX and our batches use several threads.
The models are not the same (soromox integrates distributed mass along a rod, ours has a body at each head),
but answer the same question for the same robot. Compilation is not counted.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import bha

ARM = bha.robots.load("bha_nominal")
MEMBERS = 64
RNG = np.random.default_rng(0)
Q, QD = RNG.uniform(0.15, 0.25, (MEMBERS, 9)), RNG.uniform(-0.2, 0.2, (MEMBERS, 9))
P = RNG.uniform(1.1e5, 1.5e5, (MEMBERS, 9))
SIDES = ["soromox", "bha"]


@cache
def soromox() -> dict[str, Any]:
    """soromox's functions, compiled, and states of the same size as ours."""
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    pytest.importorskip("soromox")
    from jax import lax  # noqa: PLC0415
    from jax import numpy as jnp  # noqa: PLC0415
    from soromox.systems.components import LinkSpec  # noqa: PLC0415
    from soromox.systems.pcs import PCS, PCSStructure  # noqa: PLC0415

    selector = jnp.asarray([False, True, True, True, False, False] * 3)  # two bendings and stretch, as ours
    link = LinkSpec.circular(length=0.2, radius=0.05, density=400.0, young_modulus=2e5, poisson_ratio=0.45,
                             reference_strain=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                             material_damping_coefficient=200.0)  # fmt: skip
    arm = PCS.from_links([link] * 3, structure=PCSStructure(strain_selector=selector, num_gauss_points=5))

    def rate(y: Any) -> Any:
        return arm.forward_dynamics(jnp.asarray(0.0), y)

    def second(y: Any) -> Any:
        h = 1e-3

        def step(y: Any, _: None) -> tuple[Any, None]:
            k1 = rate(y)
            k2 = rate(y + 0.5 * h * k1)
            k3 = rate(y + 0.5 * h * k2)
            k4 = rate(y + h * k3)
            return y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), None

        return lax.scan(step, y, None, length=1000)[0]

    y = jnp.asarray(np.hstack([RNG.uniform(-0.05, 0.05, (MEMBERS, 9)), np.zeros((MEMBERS, 9))]))
    functions = {
        "state": (jax.jit(rate), y[0]),
        "second": (jax.jit(second), y[0]),
        "seconds": (jax.jit(jax.vmap(second)), y),
    }
    for function, argument in functions.values():
        assert bool(jnp.isfinite(function(argument)).all())
    return functions


def run_soromox(benchmark: Any, name: str, rounds: int) -> None:
    function, argument = soromox()[name]
    benchmark.pedantic(lambda: function(argument).block_until_ready(), rounds=rounds, warmup_rounds=1)


@pytest.mark.parametrize("side", SIDES)
def test_one_state(benchmark: Any, side: str) -> None:
    benchmark.extra_info.update(table="against soromox", row="forward dynamics, one state", side=side)
    if side == "soromox":
        run_soromox(benchmark, "state", 200)
    else:
        benchmark(ARM.forward_dynamics, Q[0], QD[0], P[0])


@pytest.mark.parametrize("side", SIDES)
def test_one_second(benchmark: Any, side: str) -> None:
    benchmark.extra_info.update(table="against soromox", row="1 s, RK4 at 1 ms", side=side)
    if side == "soromox":
        run_soromox(benchmark, "second", 5)
    else:
        drive = bha.Input.constant(P[0], 1.0)
        benchmark(lambda: bha.simulate(ARM, drive, dt=1.0, method="rk4"))


@pytest.mark.parametrize("side", SIDES)
def test_a_batch_of_seconds(benchmark: Any, side: str) -> None:
    row = f"1 s, RK4 at 1 ms, {MEMBERS} trajectories"
    benchmark.extra_info.update(table="against soromox", row=row, side=side)
    if side == "soromox":
        run_soromox(benchmark, "seconds", 3)
        return
    drives = [bha.Input.constant(p, 1.0) for p in P]
    x0 = np.hstack([Q, np.zeros((MEMBERS, 9))])
    benchmark(lambda: bha.simulate_batch(ARM, drives, x0, times=np.array([0.0, 1.0]), method="rk4", step=1e-3))
