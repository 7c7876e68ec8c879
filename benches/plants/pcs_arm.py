"""Logs of a piecewise-constant-strain arm made with soromox (JAX): one section, several elements, chambers that taper.

    python -m benches.plants.pcs_arm --pool DIR [--seed 1] [--commanded] ...

writes a pool of six logs (four to train, two held out; 20 s at 100 Hz) and the tape-measure file into DIR and the truth
to ``DIR.sealed/truth.json``. The plant is slow: logs that are there are kept, so that an interrupted pool goes on where
it stopped. Its own: curvature varies along the arm (four elements of their own strains, gravity, chambers whose
distance from the backbone falls towards the tip), mass is spread along it, and the actuation map is soromox's own,
work-conjugate on the routed lengths. There is no true arc: what counts is the lateral error of the tip on held-out
logs.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import common

Array = NDArray[np.float64]

NAMES = ("train_1", "train_2", "train_3", "train_4", "holdout_1", "holdout_2")
ELEMENTS = 4
CHAMBERS = 3
STEP = 1.25e-4
LEAD = 2.0


def draw_arm(rng: np.random.Generator) -> dict[str, float]:
    """Numbers of the arm, SI."""
    return {
        "length": float(rng.uniform(0.22, 0.30)),
        "radius": float(rng.uniform(0.020, 0.026)),
        "density": float(rng.uniform(900.0, 1100.0)),
        "young_modulus": float(np.exp(rng.uniform(np.log(1.5e5), np.log(3.5e5)))),
        "viscosity": float(rng.uniform(2e3, 5e3)),  # three times the material damping coefficient, Pa s
        "chamber_area": float(rng.uniform(1.2e-4, 2.0e-4)),
        "chamber_radius": float(rng.uniform(0.012, 0.016)),
        "taper": float(rng.uniform(0.15, 0.4)),  # share of that radius lost at the tip
        "azimuth": float(rng.uniform(0.0, 2.0 * np.pi)),
        "lag": float(rng.uniform(0.05, 0.2)),
        "highest": float(rng.uniform(3.0e4, 6.0e4)),
    }


def build(numbers: dict[str, float]) -> Any:
    """The soromox robot: straight it points along the world's z; gravity pulls that way, so that it hangs."""
    import jax  # noqa: PLC0415

    jax.config.update("jax_enable_x64", True)
    from jax import numpy as jnp  # noqa: PLC0415
    from soromox.actuation import ThreadlikeActuator, ThreadlikeRouting  # noqa: PLC0415
    from soromox.systems.components import LinkSpec  # noqa: PLC0415
    from soromox.systems.pcs import PCS, PCSStructure  # noqa: PLC0415

    link = LinkSpec.circular(
        length=numbers["length"] / ELEMENTS,
        radius=numbers["radius"],
        density=numbers["density"],
        young_modulus=numbers["young_modulus"],
        poisson_ratio=0.45,
        reference_strain=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        material_damping_coefficient=numbers["viscosity"] / 3.0,
    )
    angles = numbers["azimuth"] + 2.0 * np.pi * np.arange(CHAMBERS) / CHAMBERS
    r = numbers["chamber_radius"]
    around = np.stack([np.zeros(CHAMBERS), np.cos(angles), np.sin(angles)], axis=1)
    routing = ThreadlikeRouting.linear(
        intercept=jnp.asarray(r * around),
        slope=jnp.asarray(-numbers["taper"] * r / numbers["length"] * around),
        start_segment_index=0,
        end_segment_index=ELEMENTS - 1,
    )
    chambers = ThreadlikeActuator.pressure_chambers(
        routing, effective_areas=jnp.full((CHAMBERS,), numbers["chamber_area"])
    )
    # Two bendings and the stretch of each element.
    selector = jnp.asarray([False, True, True, True, False, False] * ELEMENTS)
    return PCS.from_links(
        [link] * ELEMENTS,
        structure=PCSStructure(strain_selector=selector, num_gauss_points=5),
        gravity=jnp.asarray([0.0, 0.0, 9.81]),
        actuators=chambers,
    )


def stepper(robot: Any) -> Any:
    """A compiled function: state and pressures over the steps of a log, (rows, per, chambers), to states at the
    rows."""
    import jax  # noqa: PLC0415
    from jax import lax  # noqa: PLC0415
    from jax import numpy as jnp  # noqa: PLC0415

    zero = jnp.asarray(0.0)

    def step(y: Any, u: Any) -> tuple[Any, None]:
        def rate(state: Any) -> Any:
            return robot.forward_dynamics(zero, state, (u,))

        k1 = rate(y)
        k2 = rate(y + 0.5 * STEP * k1)
        k3 = rate(y + 0.5 * STEP * k2)
        k4 = rate(y + STEP * k3)
        return y + STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), None

    def row(y: Any, pressures: Any) -> tuple[Any, Any]:
        return lax.scan(step, y, pressures)[0], robot.forward_kinematics_tips(y[: 3 * ELEMENTS])[-1, :3, 3]

    return jax.jit(lambda y, u: lax.scan(row, y, u))


def chamber_pressures(commands: Array, per: int, lag: float) -> Array:
    """Gauge pressures on the grid of steps: first-order lag of held commands, (rows * per, chambers)."""
    fine = np.repeat(commands, per, axis=0)
    keep = float(np.exp(-STEP / lag))
    out = fine.copy()
    for k in range(1, out.shape[0]):
        out[k] = fine[k] + (out[k - 1] - fine[k]) * keep
    return out


def tape_measure(numbers: dict[str, float]) -> common.Guess:
    """The arm as one arc with three springs; rough on purpose where a rod has no such thing."""
    area = np.pi * numbers["radius"] ** 2
    stiffness = numbers["young_modulus"] * area / numbers["length"] / CHAMBERS
    second = 0.25 * np.pi * numbers["radius"] ** 4
    # The backbone's own y and z axes are the world's y and -x; a chamber bends the arm away from itself, as a bellows.
    angles = tuple(numbers["azimuth"] + 0.5 * np.pi + 2.0 * np.pi * k / CHAMBERS for k in range(CHAMBERS))
    return common.Guess(
        mass=numbers["density"] * area * numbers["length"],
        length=numbers["length"],
        radius=numbers["chamber_radius"],
        outer_radius=0.5 * numbers["radius"],
        area=numbers["chamber_area"],
        stiffness=stiffness,
        damping=numbers["viscosity"] / numbers["young_modulus"] * stiffness,
        bending=max(
            0.0,
            numbers["young_modulus"] * second / numbers["length"] - 1.5 * stiffness * numbers["chamber_radius"] ** 2,
        ),
        angles=angles,
        gravity=(0.0, 0.0, 9.81),
        highest_pressure=numbers["highest"],
    )


def _same_pool(out: Path, wanted: dict[str, Any]) -> None:
    """Refuse to mix logs that were made otherwise. Raises ValueError."""
    path = out / "pool.json"
    if path.exists() and (found := json.loads(path.read_text(encoding="utf-8"))) != wanted:
        other = {k: v for k, v in found.items() if wanted.get(k) != v}
        raise ValueError(f"{out} holds logs made with {other}; take another folder, or remove it")
    path.write_text(json.dumps(wanted, indent=1) + "\n", encoding="utf-8")


def make(seed: int, out: Path, setup: common.Setup, duration: float = 20.0, names: tuple[str, ...] = NAMES) -> None:
    """Write the logs of the pool that are not there yet, the file and the truth."""
    root = np.random.SeedSequence([seed, 20261129, 2])
    plant, file, camera_rng = (np.random.default_rng(s) for s in root.spawn(3))
    numbers = draw_arm(plant)
    true = tape_measure(numbers)
    camera = common.camera_of(camera_rng, setup)
    out.mkdir(parents=True, exist_ok=True)
    _same_pool(out, {"seed": seed, "duration": duration, "step": STEP, "elements": ELEMENTS, **asdict(setup)})
    (out / "arm.toml").write_text(
        common.arm_file(common.guessed(file, true), setup, "piecewise constant strain"), encoding="utf-8"
    )
    common.write_truth(out, setup, true, {**numbers, "camera": [*map(float, camera[0]), *map(float, camera[1])]})
    todo = [k for k, name in enumerate(names) if not (out / f"{name}.csv").exists()]
    if not todo:
        return
    robot = build(numbers)
    run = stepper(robot)
    per = round(1.0 / (common.RATE * STEP))
    times = np.arange(round((LEAD + duration) * common.RATE) + 1) / common.RATE
    for k in todo:
        inputs, noise = (np.random.default_rng(s) for s in np.random.SeedSequence([seed, 20261129, 3, k]).spawn(2))
        share = (common.held_steps, common.multisine)[k % 2](inputs, times, CHAMBERS)
        commands = numbers["highest"] * share
        pressures = chamber_pressures(commands, per, numbers["lag"])
        start = np.zeros(6 * ELEMENTS)
        _, tips = run(start, pressures.reshape(times.shape[0], per, CHAMBERS))
        if not np.isfinite(tips).all():
            raise RuntimeError(
                f"{names[k]}: the simulation diverges at a step of {STEP:g} s; the arm damps too fast for it"
            )
        place = np.asarray(tips)
        first = round(LEAD * common.RATE)
        logged = commands if setup.commanded else pressures[::per]
        part = out / f"{names[k]}.part"
        common.write_log(part, noise, setup, logged[first:], place[first:], camera)
        part.rename(out / f"{names[k]}.csv")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pool", type=Path, required=True)
    parser.add_argument("--duration", type=float, default=20.0, help="of each log [s]")
    common.setup_options(parser)
    arguments = parser.parse_args()
    make(arguments.seed, arguments.pool, common.setup_from(arguments), arguments.duration)
    print(json.dumps({"pool": str(arguments.pool), "logs": sorted(p.name for p in arguments.pool.glob("*.csv"))}))


if __name__ == "__main__":
    main()
