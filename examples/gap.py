"""A gap, its name, and the gap after: the picture of the front page, ``python examples/gap.py --out docs/figures``.

An arm of two sections has one bellows that is 30 % softer than its file says. Three logs of 20 s with noise; the
diagnosis sees two of them and the file, the third one proves it. Takes about a minute.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import bha
from bha.parameters import ArmParameters
from bha.plot import write_figure
from bha.plot.style import COLORS, figure_of_size
from bha.viewer.motions import Moment
from bha.viewer.still import Still

TIME = np.arange(0.0, 20.0, 0.02)
BLUE, ORANGE = COLORS[1:3]


def two_sections() -> bha.Arm:
    """The first two sections of the nominal arm."""
    nominal = bha.robots.load("bha_nominal").parameters.to_mapping()
    return bha.Arm.from_parameters(ArmParameters.from_mapping({**nominal, "section": nominal["section"][:2]}))


def measured(arm: bha.Arm, seed: int) -> tuple[bha.Log, bha.Trajectory]:
    """A log of an arm under sines of chance, with the noise of its sensors; and the motion without it."""
    random = np.random.default_rng(seed)
    phases, sizes, rates = (
        random.uniform(0, 6.3, (4, 6)),
        random.uniform(8e3, 2.4e4, (4, 6)),
        random.uniform(0.05, 0.9, 4),
    )
    waves = (sizes[:, None] * np.sin(2 * np.pi * rates[:, None, None] * TIME[:, None] + phases[:, None])).sum(axis=0)
    pressures = np.clip(1.15e5 + waves, 0.8e5, 1.6e5)
    run = bha.simulate(arm, bha.Input(TIME, pressures), times=TIME)
    noisy_pressures = pressures + random.normal(scale=50.0, size=pressures.shape)
    noisy_lengths = run.lengths + random.normal(scale=3e-4, size=run.lengths.shape)
    columns = {f"{name} [Pa]": values for name, values in zip(arm.inputs, noisy_pressures.T, strict=True)}
    columns |= {f"q{1 + k // 3}{1 + k % 3} [m]": values for k, values in enumerate(noisy_lengths.T)}
    return bha.Log.from_arrays({"t [s]": TIME, **columns}), run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"))
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    file = two_sections()
    true = file.with_effects([{"kind": "weak_bellows", "where": "bellows 22", "change": -0.3}])
    (one, _), (two, _), (proof, motion) = (measured(true, seed) for seed in (1, 2, 3))
    found = bha.diagnose(file, [one, two], [proof], out=folder / "gap", report=False)
    (effect,) = found.effects
    change = effect.parameters["change"]
    print(f"{found.verdict}: {effect.kind} at {effect.where}, {change.value:+.3f}, 95 % {change.ci95}")
    print(f"gap {1e3 * found.gap.before:.2f} mm, after {1e3 * found.gap.after:.2f}, noise {1e3 * found.gap.noise:.2f}")

    named = bha.Arm.load(folder / "gap" / "arm_diagnosed.toml")
    before, after = (bha.simulate(arm, proof, times=TIME) for arm in (file, named))
    off = [1e3 * np.linalg.norm((run.head_positions - motion.head_positions)[:, -1], axis=1) for run in (before, after)]
    late = TIME > 1.0  # both are set going by the first pressures
    row = int(np.argmax(late * off[0] * np.linalg.norm(motion.head_positions[:, -1, :2], axis=1)))
    # The arm as its file says, and arrows to where the heads of the true one are.
    moment = Moment(
        before.lengths[row], proof_pressures(proof, file)[row], before.head_positions[row], motion.head_positions[row]
    )
    picture = Still(file, compared=True).draw([moment], magnify=5)
    with figure_of_size(7.4, 3.0) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1, 2.2))
        left.imshow(picture[:640, 190:770])
        left.axis("off")
        left.set_title(f"at {TIME[row]:.1f} s; arrows: the gap, 5 times", fontsize=8)
        right.plot(TIME, off[0], color=ORANGE, linestyle="--", linewidth=1.1, label="model of the file")
        right.plot(TIME, off[1], color=BLUE, linewidth=1.4, label="with what was named")
        right.set(
            xlabel="time, on a log that took no part [s]", ylabel="tip is off by [mm]", ylim=(0, 1.25 * off[0].max())
        )
        said = f"bellows 2 of section 2 is {-100 * change.value:.0f} % softer than the file says"
        right.set_title(f"named: {said}", fontsize=9, weight="bold")
        right.legend(loc="upper right", ncols=2)
        write_figure(figure, folder / "gap.png")


def proof_pressures(log: bha.Log, arm: bha.Arm) -> np.ndarray:
    """The pressures of a log in the order of the arm's inputs, Pa, shape (rows, inputs)."""
    return np.stack([log[name] for name in arm.inputs], axis=-1)


if __name__ == "__main__":
    main()
