"""What both plants share: programmes of commands, the user's setup and its faults, tape-measure files, logs.

Base frame of the files: z along the straight arm away from its base. A measured position is ``R^T (p - c)`` where the
camera's frame stands at ``c`` and is turned by ``R``.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AMBIENT = 101325.0
RATE = 100.0
NAMES = ("train_1", "train_2", "train_3", "holdout_1", "holdout_2")


@dataclass(frozen=True)
class Setup:
    """How the user set things up.

    Attributes:
        commanded: the log holds commands alone instead of measured pressures.
        azimuth_off: the file's azimuths are turned by so much, degrees.
        swapped: two chambers have changed places.
        camera: the camera stands beside the base, 8 to 25 mm away and up to 5 degrees turned.
        noise: of the tip's coordinates, m.
        pressure_noise: of the measured pressures, Pa.
    """

    commanded: bool = False
    azimuth_off: float = 0.0
    swapped: bool = False
    camera: bool = False
    noise: float = 2e-4
    pressure_noise: float = 200.0


@dataclass(frozen=True)
class Guess:
    """What a tape measure, a scale and a guess say of a one-section arm with parallel chambers; SI, angles in rad."""

    mass: float
    length: float
    radius: float
    outer_radius: float
    area: float
    stiffness: float
    damping: float
    bending: float
    angles: tuple[float, ...]
    gravity: tuple[float, float, float]
    highest_pressure: float  # gauge


def held_steps(rng: np.random.Generator, times: Array, inputs: int, dwell: tuple[float, float] = (1.5, 5.0)) -> Array:
    """Levels from 0 to 1 that are held for seconds; four changes in ten are of one chamber only."""
    out = np.empty((times.shape[0], inputs))
    level = rng.uniform(0.0, 1.0, inputs)
    t = float(times[0])
    out[:] = level
    while t < times[-1]:
        t += float(rng.uniform(*dwell))
        target = rng.uniform(0.0, 1.0, inputs)
        if rng.random() < 0.4:
            target = np.where(np.arange(inputs) == rng.integers(inputs), target, level)
        out[times >= t] = target
        level = target
    return out


def multisine(rng: np.random.Generator, times: Array, inputs: int, highest: float = 0.8) -> Array:
    """Ten lines from 0.03 Hz to ``highest``, from 0 to 1."""
    lines = np.geomspace(0.03, highest, 10) * rng.uniform(0.9, 1.1, (inputs, 10))
    phases = rng.uniform(0.0, 2.0 * np.pi, (inputs, 10))
    waves = [np.sin(2.0 * np.pi * times[:, None] * lines[j] + phases[j]) @ lines[j] ** -0.5 for j in range(inputs)]
    return np.asarray(np.clip(0.5 + 0.2 * np.stack([w / np.std(w) for w in waves], axis=1), 0.0, 1.0))


def programme(rng: np.random.Generator, number: int, times: Array, inputs: int) -> Array:
    """Shares of the greatest pressure for log ``number``: steps and multisines take turns, the last log is half
    each."""
    if number == len(NAMES) - 1:
        cut = times.shape[0] // 2
        return np.concatenate([held_steps(rng, times[:cut], inputs), multisine(rng, times[cut:], inputs)])
    return (held_steps, multisine)[number % 2](rng, times, inputs)


def guessed(rng: np.random.Generator, true: Guess, factor: float = 3.0) -> Guess:
    """A tape-measure file: mass and geometry to 5 %, stiffness, damping, bending and area within a factor."""

    def off() -> float:
        return float(rng.uniform(0.95, 1.05))

    def wild() -> float:
        return float(factor ** rng.uniform(-1.0, 1.0))

    return Guess(
        true.mass * off(),
        true.length * off(),
        true.radius * off(),
        true.outer_radius * off(),
        true.area * wild(),
        true.stiffness * wild(),
        true.damping * wild(),
        max(true.bending, 0.1 * true.radius**2 * true.stiffness) * wild(),
        true.angles,
        true.gravity,
        true.highest_pressure,
    )


def arm_file(guess: Guess, setup: Setup, name: str) -> str:
    """Parameter file of the guess, with the setup's wrong azimuths and order."""
    angles = [np.rad2deg(a) + setup.azimuth_off for a in guess.angles]
    if setup.swapped:
        angles[0], angles[1] = angles[1], angles[0]
    lines = [
        "# Mass from a scale, geometry from a tape measure, the rest guessed.",
        'schema = "bha-arm/1"',
        f'name = "{name}"',
        f"gravity = [{', '.join(f'{g:g}' for g in guess.gravity)}]",
        f"ambient_pressure = {AMBIENT}",
        'force_model = "work_conjugate"',  # as ``bha new`` writes it
        "",
        "[[section]]",
        f"mass = {guess.mass:.4g}",
        f"bellows_radius = {guess.radius:.4g}",
        f"bellows_outer_radius = {guess.outer_radius:.4g}",
        f"terminal_area = {guess.area:.4g}",
        f"rest_length = {guess.length:.4g}",
        f"stiffness = [{guess.stiffness:.4g}]",
        f"damping = {guess.damping:.4g}",
        f"bending_stiffness = [{guess.bending:.4g}]",
        f"length_range = [{0.6 * guess.length:.4g}, {1.6 * guess.length:.4g}]",
        f"pressure_range = [{AMBIENT - 1000.0:.6g}, {AMBIENT + 1.05 * guess.highest_pressure:.6g}]",
    ]
    for k, angle in enumerate(angles):
        lines += ["", "[[section.bellows]]", f"angle_deg = {angle % 360.0:.4g}", f'input = "p1{k + 1}"']
    return "\n".join(lines) + "\n"


def camera_of(rng: np.random.Generator, setup: Setup) -> tuple[Array, Array]:
    """Place and rotation vector of the camera's frame."""
    place, turn = rng.normal(size=3), rng.normal(size=3)
    place *= rng.uniform(8e-3, 25e-3) / np.linalg.norm(place)
    turn *= np.deg2rad(rng.uniform(0.0, 5.0)) / np.linalg.norm(turn)
    return (place, turn) if setup.camera else (np.zeros(3), np.zeros(3))


def rotation(vector: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def write_log(
    path: Path, rng: np.random.Generator, setup: Setup, pressures: Array, tip: Array, camera: tuple[Array, Array]
) -> None:
    """One log at RATE: gauge pressures in kPa (commands as ``pc``), and the tip in metres as the camera sees it."""
    seen = (tip - camera[0]) @ rotation(camera[1]) + setup.noise * rng.standard_normal(tip.shape)
    if not setup.commanded:
        pressures = pressures + setup.pressure_noise * rng.standard_normal(pressures.shape)
    prefix = "pc" if setup.commanded else "p"
    header = ["t [s]", *(f"{prefix}1{k + 1} [kPa(g)]" for k in range(pressures.shape[1])), "x1 [m]", "y1 [m]", "z1 [m]"]
    table = np.column_stack([np.arange(tip.shape[0]) / RATE, 1e-3 * pressures, seen])
    style = ["%.2f", *["%.4f"] * pressures.shape[1], *["%.6f"] * 3]
    np.savetxt(path, table, fmt=style, delimiter=",", header=",".join(header), comments="")


def write_truth(out: Path, setup: Setup, true: Guess, numbers: dict[str, Any]) -> None:
    """The truth beside the folder and not in it: ``<out>.sealed/truth.json``."""
    folder = out.with_name(out.name + ".sealed")
    folder.mkdir(parents=True, exist_ok=True)
    truth = {"setup": asdict(setup), "arm": asdict(true), **numbers}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


def setup_options(parser: Any) -> None:
    """Options of the setup on a command line."""
    parser.add_argument("--commanded", action="store_true", help="commands alone instead of measured pressures")
    parser.add_argument("--azimuth-off", type=float, default=0.0, metavar="DEG", help="turn the file's azimuths")
    parser.add_argument("--swapped", action="store_true", help="two chambers have changed places")
    parser.add_argument("--camera", action="store_true", help="the camera stands beside the base and is turned")
    parser.add_argument("--noise", type=float, default=0.2, help="of the tip's coordinates [mm]")


def setup_from(arguments: Any) -> Setup:
    """The setup that a command line asks for."""
    return Setup(
        arguments.commanded, arguments.azimuth_off, arguments.swapped, arguments.camera, 1e-3 * arguments.noise
    )
