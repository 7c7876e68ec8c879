"""Ambiguous, experiment, named: what logs cannot tell apart, the pressures that would, and what they tell.

    python examples/next_experiment.py --out out

A section with one bellows a quarter softer than its file says is moved by one chamber alone. A diagnosis of these logs
finds the gap, and that a hose, a tilted base and the soft bellows explain it alike. It proposes pressures; run on the
same arm, they leave one name.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bha
from bha.diagnosis import headline
from bha.parameters import ArmParameters

Array = NDArray[np.float64]
RATE, LENGTH_NOISE, PRESSURE_NOISE = 100.0, 3e-4, 100.0


def one_section() -> bha.Arm:
    """The first section of the nominal arm."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    return bha.Arm.from_parameters(ArmParameters.from_mapping({**mapping, "section": mapping["section"][:1]}))


def measured(arm: bha.Arm, time: Array, pressures: Array, random: np.random.Generator) -> bha.Log:
    """What sensors would log of the arm under some pressures."""
    run = bha.simulate_batch(arm, bha.Input(time, pressures), times=time)
    columns = {"t [s]": time}
    for k in range(3):
        columns[f"p1{k + 1} [Pa]"] = pressures[:, k] + PRESSURE_NOISE * random.standard_normal(len(time))
        columns[f"q1{k + 1} [m]"] = run.lengths[0, :, k] + LENGTH_NOISE * random.standard_normal(len(time))
    return bha.Log.from_arrays(columns)


def one_chamber(level: float) -> tuple[Array, Array]:
    """Ten seconds in which chamber 2 goes up to a level, Pa, and back, over a fifth of a second."""
    time = np.arange(0.0, 10.0, 1.0 / RATE)
    pressures = np.full((len(time), 3), 1.1e5)
    pressures[:, 1] = np.interp(time, [2.0, 2.2, 6.0, 6.2], [1.1e5, level, level, 1.1e5])
    return time, pressures


def main() -> None:
    """Run the whole story."""
    parser = argparse.ArgumentParser(description="Ambiguous, experiment, named.")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the results")
    out = parser.parse_args().out / "next_experiment"
    out.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(1)
    filed = one_section()
    real = filed.with_effects([{"kind": "weak_bellows", "where": "bellows 12", "change": -0.25}])
    first = [measured(real, *one_chamber(level), random) for level in (1.35e5, 1.3e5)]

    found = bha.diagnose(filed, first[:1], first[1:], out=out / "first")
    print(f"One chamber alone: {found.verdict}. {headline(found)}.")
    proposed = found.next_experiment
    if proposed is None or proposed.file is None:
        print("Nothing is left open.")
        return
    print(f"Proposed: {out / 'first' / proposed.file}, {proposed.distance:.0f} standard deviations apart.")

    commands = bha.Log.read(out / "first" / proposed.file)
    log = measured(real, commands.time, commands.pressures(filed.inputs, commanded=True), random)
    end = float(log.time[-1])
    train, held = log.between(0.0, 0.6 * end), log.between(0.6 * end, end)
    found = bha.diagnose(filed, [first[0], train], [first[1], held], out=out / "second")
    print(f"With it: {found.verdict}. {headline(found)}.")
    print(f"Reports: {out / 'first' / 'report.html'}, {out / 'second' / 'report.html'}")


if __name__ == "__main__":
    main()
