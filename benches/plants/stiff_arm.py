"""Logs of a made-up arm that is stiff in length and soft in bending, of which one chamber of three is driven.

    python -m benches.plants.stiff_arm --seed 1 --out DIR --guess 800 [--commanded] [--camera]

The plant is that of the wide blind world (``benches/blind``), with a backbone along the middle of the section: springs
at the chambers' radius tie stretching and bending together (three of k at r give 3 k in length and 1.5 k r^2 in
bending), a backbone adds to the first alone. The file knows no backbone and guesses the stiffness of the chambers as
``--guess`` says: from 800, 3,000 and 20,000 N/m the same answer is wanted.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import common

sys.path.insert(0, str(Path(__file__).parents[1] / "blind"))

Array = NDArray[np.float64]

CHAMBERS = 3
HIGHEST = 2.0e5
LEAD = 2.0


def draw_arm(rng: np.random.Generator) -> dict[str, float]:
    """Numbers of the arm, SI."""
    return {
        "mass": float(rng.uniform(0.10, 0.25)),
        "length": float(rng.uniform(0.16, 0.20)),
        "radius": float(rng.uniform(0.018, 0.025)),
        "area": float(rng.uniform(1.5e-4, 3.0e-4)),
        "stiffness": float(rng.uniform(700.0, 1500.0)),
        "backbone": float(rng.uniform(1.5e4, 4.0e4)),
        "bending": float(rng.uniform(0.3, 0.8)),
        "relaxation": float(np.exp(rng.uniform(np.log(0.05), np.log(0.3)))),
        "lag": float(rng.uniform(0.03, 0.15)),
        "azimuth": float(rng.uniform(0.0, 2.0 * np.pi)),
    }


def build(numbers: dict[str, float]) -> Any:
    """The truth of the wide world for these numbers: three chambers, and a backbone without area at the middle."""
    from blindgen.wide import bellows as b  # noqa: PLC0415
    from blindgen.wide.arms import Bellows, Section, TrueArm, solid_inertia  # noqa: PLC0415
    from blindgen.wide.arms import build as arrays  # noqa: PLC0415
    from blindgen.wide.truth import plain_truth  # noqa: PLC0415

    lengths = (0.6 * numbers["length"], 1.5 * numbers["length"])
    inertia = solid_inertia(numbers["mass"], numbers["radius"], 0.4 * numbers["radius"], lengths)
    k = numbers["stiffness"]
    section = Section(
        mass=numbers["mass"],
        inertia=(inertia[0], inertia[1], inertia[2]),
        radius=numbers["radius"],
        outer_radius=0.4 * numbers["radius"],
        area=numbers["area"],
        rest_length=numbers["length"],
        stiffness=(k, 0.0, 0.0),
        damping=numbers["relaxation"] * k,
        bending=(numbers["bending"], 0.0),
        hardening=(0.0, 0.0),
        sliced=0.0,
        length_range=lengths,
        pressure_range=(common.AMBIENT, common.AMBIENT + HIGHEST),
        bellows=tuple(
            Bellows(numbers["azimuth"] + 2.0 * np.pi * c / CHAMBERS, numbers["radius"], f"p1{c + 1}")
            for c in range(CHAMBERS)
        ),
    )
    arm = TrueArm("fabric", "upright", (0.0, 0.0, -9.81), common.AMBIENT, "work_conjugate", (section,))
    made = arrays(arm)
    middle = made.table[:1].copy()
    middle[:, [b.B_X, b.B_Y, b.B_AREA]] = 0.0
    middle[:, b.B_STIFFNESS] = numbers["backbone"]
    middle[:, b.B_DAMPING] = numbers["relaxation"] * numbers["backbone"]
    return plain_truth(made._replace(table=np.concatenate([made.table, middle])), CHAMBERS)


def make(seed: int, out: Path, setup: common.Setup, guess: float, duration: float = 60.0) -> dict[str, Any]:
    """Write one case and return its truth."""
    from blindgen.wide.integrate import STEP  # noqa: PLC0415
    from blindgen.wide.pressures import PressureSense, chamber_pressures  # noqa: PLC0415
    from blindgen.wide.truth import simulate  # noqa: PLC0415

    root = np.random.SeedSequence([seed, 20261129, 4])
    plant, inputs, file, noise, camera_rng = (np.random.default_rng(s) for s in root.spawn(5))
    numbers = draw_arm(plant)
    truth = build(numbers)
    camera = common.camera_of(camera_rng, setup)
    out.mkdir(parents=True, exist_ok=True)
    per = round(1.0 / (common.RATE * STEP))
    times = np.arange(round((LEAD + duration) * common.RATE) + 1) / common.RATE
    sense = PressureSense("measured", numbers["lag"], 0.0, 0.0, 0.0, "Pa")
    first = round(LEAD * common.RATE)
    for number, name in enumerate(common.NAMES):
        share = np.zeros((times.shape[0], CHAMBERS))
        share[:, :1] = common.programme(inputs, number, times, 1)
        wanted = HIGHEST * share
        fine = np.concatenate([np.repeat(wanted[:-1], per, axis=0), wanted[-1:]])
        chamber = chamber_pressures(sense, common.AMBIENT + fine, STEP)
        clean = simulate(truth, chamber, first * per, STEP, per)
        gauge = wanted[first:] if setup.commanded else chamber[first * per :: per] - common.AMBIENT
        common.write_log(out / f"{name}.csv", noise, setup, gauge, clean.heads[:, -1, :3], camera)
    true = common.Guess(
        numbers["mass"], numbers["length"], numbers["radius"], 0.4 * numbers["radius"], numbers["area"],
        numbers["stiffness"], numbers["relaxation"] * numbers["stiffness"], numbers["bending"],
        tuple(numbers["azimuth"] + 2.0 * np.pi * c / CHAMBERS for c in range(CHAMBERS)), (0.0, 0.0, -9.81), HIGHEST,
    )  # fmt: skip
    said = replace(common.guessed(file, true), stiffness=guess)
    (out / "arm.toml").write_text(common.arm_file(said, setup, "one driven chamber"), encoding="utf-8")
    common.write_truth(out, setup, true, {**numbers, "camera": [*map(float, camera[0]), *map(float, camera[1])]})
    return numbers


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--guess", type=float, default=3000.0, help="stiffness that the file gives [N/m]")
    parser.add_argument("--duration", type=float, default=60.0, help="of each log [s]")
    common.setup_options(parser)
    arguments = parser.parse_args()
    setup = common.setup_from(arguments)
    print(make(arguments.seed, arguments.out, setup, arguments.guess, arguments.duration))


if __name__ == "__main__":
    main()
