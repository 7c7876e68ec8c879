"""A gap, its name, and the gap after: the picture of the front page, ``python examples/gap.py --out docs/figures``.

An arm of two sections has one bellows that is 30 % softer than its file says. Three logs of 20 s with noise; the
diagnosis sees two of them and the file, the third one proves it. Takes about a minute.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np

import bha
from bha.parameters import ArmParameters
from bha.plot import COLORS, figure_of_size, write_figure
from bha.viewer import draw_arm, motions_of

TIME = np.arange(0.0, 20.0, 0.02)


def two_sections() -> bha.Arm:
    """The first two sections of the nominal arm."""
    nominal = bha.robots.load("bha_nominal").parameters.to_mapping()
    return bha.Arm.from_parameters(ArmParameters.from_mapping({**nominal, "section": nominal["section"][:2]}))


def measured(arm: bha.Arm, seed: int, heads: bool = False) -> bha.Log:
    """A log of an arm under sines of chance: noisy pressures and lengths, or heads besides."""
    random = np.random.default_rng(seed)
    phases, sizes = random.uniform(0.0, 6.3, (4, 6)), random.uniform(8e3, 2.4e4, (4, 6))
    angles = 2 * np.pi * random.uniform(0.05, 0.9, 4)[:, None, None] * TIME[:, None] + phases[:, None]
    pressures = np.clip(1.15e5 + (sizes[:, None] * np.sin(angles)).sum(axis=0), 0.8e5, 1.6e5)
    run = bha.simulate(arm, bha.Input(TIME, pressures), times=TIME)
    columns = {f"{name} [Pa]": p for name, p in zip(arm.inputs, random.normal(pressures, 50.0).T, strict=True)}
    columns |= {f"q{1 + k // 3}{1 + k % 3} [m]": q for k, q in enumerate(random.normal(run.lengths, 3e-4).T)}
    if heads:
        places = itertools.product((1, 2), "xyz")
        columns |= {f"{axis}{k} [m]": run.head_positions[:, k - 1, "xyz".index(axis)] for k, axis in places}
    return bha.Log.from_arrays({"t [s]": TIME, **columns})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"))
    folder = parser.parse_args().out
    file = two_sections()
    true = file.with_effects([{"kind": "weak_bellows", "where": "bellows 22", "change": -0.3}])
    logs = [measured(true, seed) for seed in (1, 2, 3)]
    found = bha.diagnose(file, logs[:2], logs[2:], out=folder / "gap", report=False)
    (effect,) = found.effects
    change = effect.parameters["change"]
    print(f"{found.verdict}: {effect.kind} at {effect.where}, {change.value:+.3f}, 95 % {change.ci95}")
    print(f"gap {1e3 * found.gap.before:.2f} mm, after {1e3 * found.gap.after:.2f}, noise {1e3 * found.gap.noise:.2f}")

    proof = measured(true, 3, heads=True)
    named = bha.Arm.load(folder / "gap" / "arm_diagnosed.toml")
    before, after = (motions_of(arm, [proof])[0] for arm in (file, named))
    off = {"model of the file": 1e3 * before.gaps()[:, -1], "with what was named": 1e3 * after.gaps()[:, -1]}
    # Far out, where the gap is large, and not at the start, where all begin alike.
    worst = float(TIME[np.argmax((TIME > 1.0) * off["model of the file"] * np.abs(proof["x2"]))])
    drawn = draw_arm(file, [before], time=worst, magnify=5.0)
    with figure_of_size(7.4, 3.0) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1, 2.2))
        left.imshow(np.asarray(drawn.canvas.buffer_rgba())[:640, 190:770])
        left.axis("off")
        left.set_title(f"at {worst:.1f} s; arrows: the gap, 5 times", fontsize=8)
        for (label, gap), color, style in zip(off.items(), (COLORS[2], COLORS[1]), ("--", "-"), strict=True):
            right.plot(TIME, gap, color=color, linestyle=style, linewidth=1.3, label=label)
        right.set_ylim(0.0, 1.25 * max(gap.max() for gap in off.values()))
        right.set(xlabel="time, on a log that took no part [s]", ylabel="tip is off by [mm]")
        said = f"bellows 2 of section 2 is {-100 * change.value:.0f} % softer than the file says"
        right.set_title(f"named: {said}", fontsize=9, weight="bold")
        right.legend(loc="upper right", ncols=2)
        write_figure(figure, folder / "gap.png")


if __name__ == "__main__":
    main()
