"""Logs of soft-robotic-arm 0.4.2 (MuJoCo): one section of four columns, five levels of springs, first-order lag.

    python -m benches.plants.mujoco_arm --seed 1 --out DIR [--commanded] [--azimuth-off 30|90|180] [--swapped]
    [--camera]

writes ``DIR/arm.toml`` (tape measure) and ``train_1..3.csv``, ``holdout_1..2.csv`` (60 s at 100 Hz); the truth goes to
``DIR.sealed/truth.json``. The seed draws moving mass, gains of bending and extension, lag and azimuth; the gains so
that the bending stiffness beside that of the springs is not negative, as it is in the calibrated arm.

Truth in the terms of one arc with four springs k at radius r and a bending stiffness: extension by pressure A/k, weight
over stiffness m g/k and k_bend/k follow from the levels in series. Levels bend at their upper ends, so that the tip
goes (levels + 1) / levels as far as that of an arc with the same bend; the bending stiffness is that of the arc whose
tip goes as far. A pressurised column pulls the tip towards itself; in our terms, where a bellows pushes the tip away,
it stands on the other side.
A/k is a truth for any model. The other two are not, and no one-arc model has both: columns stretch with the extension
gain and bend with the pressure gain, two areas where an arc has one (0.50 to 0.74 of each other, by seed), so that
weight is to bending what it is to stretching only by accident; and weight makes the shape far from an arc (the lowest
hinge has 44 to 48 % of the bend, the uppermost 4 to 5 %). What any model can be held against is in closed form
(:mod:`benches.plants.chain`): how far the tip goes across for a pascal in one column at half the greatest pressure,
with its weight and (``weightless``) without, and the mean times of its response, of the arm alone.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import common
from .chain import Chain

Array = NDArray[np.float64]

PSI = 6894.757293168
HIGHEST = 8.0  # psi
SETTLE = 6.0  # s before each log at its first command
COLUMNS = 4
TIP = 0.012  # m, the marker frame below the last level


def draw_config(rng: np.random.Generator) -> Any:
    """The package's calibrated arm with mass, gains, lag and azimuth of another one."""
    from soft_robotic_arm import ArmConfig  # noqa: PLC0415

    usual = ArmConfig()
    return ArmConfig(
        mass=usual.mass * rng.uniform(0.7, 1.5),
        tip_mass=usual.tip_mass * rng.uniform(0.5, 2.0),
        pressure_gain=usual.pressure_gain * rng.uniform(0.7, 1.0),
        extension_gain=usual.extension_gain * rng.uniform(1.5, 2.2),
        tau_pneumatic=float(np.exp(rng.uniform(np.log(0.15), np.log(0.8)))),
        seg_azimuth0_deg=float(rng.uniform(0.0, 360.0)),
    )


def truth_of(cfg: Any, mass: float) -> tuple[common.Guess, dict[str, float]]:
    """The arm in our terms, and the ratios that logs can tell."""
    levels, r = cfg.n_pouches, cfg.moment_arm
    # Four springs k side by side are what the slides are in series, and each column pushes with its gain.
    k = cfg.axial_stiffness / levels / COLUMNS
    area = cfg.extension_gain / PSI
    # Bend of the arc, rad for 1 Pa in one column.
    bend = (levels + 1) * cfg.pressure_gain * r / cfg.base_stiffness / PSI
    # One column bends 2 k r^2 and the bending stiffness by A r p.
    bending = area * r / bend - 2.0 * k * r**2
    angles = tuple(-(np.deg2rad(cfg.seg_azimuth0_deg) + np.pi + 0.5 * np.pi * c) for c in range(COLUMNS))
    arm = common.Guess(
        mass=mass,
        length=cfg.length + TIP,
        radius=r,
        outer_radius=cfg.col_radius,
        area=area,
        stiffness=k,
        damping=cfg.axial_damping / levels / COLUMNS,
        bending=bending,
        angles=angles,
        gravity=(0.0, 0.0, 9.81),
        highest_pressure=HIGHEST * PSI,
    )
    numbers = {
        "area_over_stiffness": area / k,
        "weight_over_stiffness": mass * 9.81 / k,
        "bending_over_stiffness": bending / k,
        "bend_per_pascal": bend,
        "sag": sag(cfg),
        "lag": cfg.tau_pneumatic,
        "bending_relaxation": cfg.base_damping / cfg.base_stiffness,
        "axial_relaxation": cfg.axial_damping / cfg.axial_stiffness,
        "azimuth": cfg.seg_azimuth0_deg,
        **responses(cfg),
    }
    return arm, numbers


def simulate(cfg: Any, commands: Array, seed: int) -> tuple[Array, Array]:
    """Pressures in the columns, Pa gauge (rows, 4), and tip positions in the base frame, m (rows, 3)."""
    from soft_robotic_arm import SoftArmSim  # noqa: PLC0415

    sim = SoftArmSim(cfg=cfg, control_hz=common.RATE, seed=seed, strict_segment_commands=True)
    base = np.array(sim.data.body("mount").xpos)
    for _ in range(round(SETTLE * common.RATE)):
        sim.step(commands[0])
    pressures, tips = np.empty(commands.shape), np.empty((commands.shape[0], 3))
    observed = sim.observe()
    for k, command in enumerate(commands):
        pressures[k] = observed["p_actual"].mean(axis=1) * PSI
        x, y, z = np.array(observed["tip_pos"]) - base
        # Turned about x by half a turn, so that z points down along the arm.
        tips[k] = x, -y, -z
        observed = sim.step(command)
    return pressures, tips


def chain_of(cfg: Any) -> Chain:
    """The arm's links, hinges and masses."""
    import mujoco  # noqa: PLC0415
    from soft_robotic_arm import build_arm_xml  # noqa: PLC0415

    model, h, last = mujoco.MjModel.from_xml_string(build_arm_xml(cfg)), cfg.level_height(), cfg.n_pouches - 1
    bodies = [(k, f"level{k}", 0.0) for k in range(cfg.n_pouches)]
    bodies += [(last, "tip_disc", h), (last, "tip_frame", h + TIP)]
    masses = tuple(
        (k, at - float(model.body_ipos[body][2]), float(model.body_mass[body]))
        for k, name, at in bodies
        for body in (model.body(name).id,)
    )
    return Chain(cfg.n_pouches, h, TIP, masses, cfg.base_stiffness, cfg.base_damping)


def responses(cfg: Any) -> dict[str, float]:
    """How the tip answers one column at half the greatest pressure in all: m for 1 Pa, mean times in s."""
    chain, moment = chain_of(cfg), cfg.pressure_gain * cfg.moment_arm / PSI
    pushed = COLUMNS * cfg.extension_gain * 0.5 * HIGHEST / cfg.axial_stiffness
    hung = pushed + sag(cfg) / cfg.n_pouches
    return {
        "across_per_pascal": chain.across(moment, hung),
        "weightless_per_pascal": chain.across(moment, pushed, weight=0.0),
        "time_across": chain.time(hung),
        "time_along": cfg.axial_damping / cfg.axial_stiffness,
    }


def _masses_below(cfg: Any) -> list[float]:
    """Mass from each level on, kg."""
    import mujoco  # noqa: PLC0415
    from soft_robotic_arm import build_arm_xml  # noqa: PLC0415

    model = mujoco.MjModel.from_xml_string(build_arm_xml(cfg))
    return [float(model.body_subtreemass[model.body(f"level{k}").id]) for k in range(cfg.n_pouches)]


def moving_mass(cfg: Any) -> float:
    """What a scale says: everything below the mount, kg."""
    return _masses_below(cfg)[0]


def sag(cfg: Any) -> float:
    """By how much its own weight stretches the hanging arm, m."""
    return sum(_masses_below(cfg)) * 9.81 / float(cfg.axial_stiffness)


def make(seed: int, out: Path, setup: common.Setup, duration: float = 60.0) -> dict[str, Any]:
    """Write one case and return its truth."""
    root = np.random.SeedSequence([seed, 20261129, 1])
    plant, inputs, file, noise, camera_rng = (np.random.default_rng(s) for s in root.spawn(5))
    cfg = draw_config(plant)
    true, numbers = truth_of(cfg, moving_mass(cfg))
    camera = common.camera_of(camera_rng, setup)
    out.mkdir(parents=True, exist_ok=True)
    times = np.arange(round(duration * common.RATE) + 1) / common.RATE
    for number, name in enumerate(common.NAMES):
        commands = HIGHEST * common.programme(inputs, number, times, COLUMNS)
        pressures, tips = simulate(cfg, commands, seed)
        common.write_log(
            out / f"{name}.csv", noise, setup, commands * PSI if setup.commanded else pressures, tips, camera
        )
    guess = common.guessed(file, true)
    (out / "arm.toml").write_text(common.arm_file(guess, setup, "four columns"), encoding="utf-8")
    truth = {**numbers, "camera": [*map(float, camera[0]), *map(float, camera[1])]}
    common.write_truth(out, setup, true, truth)
    return truth


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--duration", type=float, default=60.0, help="of each log [s]")
    common.setup_options(parser)
    arguments = parser.parse_args()
    print(make(arguments.seed, arguments.out, common.setup_from(arguments), arguments.duration))


if __name__ == "__main__":
    main()
