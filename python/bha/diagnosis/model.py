"""What is free in a diagnosis beside effects: an arm's plain parameters, and how far each plausibly is from its file.

What: every number that may change is a :class:`bha.estimation.free.Coordinate`, which counts in the distance that the
number plausibly has from its nominal value, so that the prior is a unit normal. The camera's frame is among them where
heads were measured: they are seen in a frame that stands some millimetres beside the arm's base and is turned by some
degrees, whatever the file says. That is no physics of the arm; left out it passes for offsets of pressures and tilts.
So are the azimuths and radii at which wires run: nobody holds a protractor to better than some degrees
(:func:`bha.estimation.scale.wires_free`).
Source: plain parameters as in the paper's identification (section IV): mass and inertia (56), longitudinal stiffness
(Fig. 8), bending stiffness (Fig. 9), damping (Fig. 10).
Validity: the scale of all forces is that of masses and areas together: areas count as known where the file says where
they come from, to a tenth where it does not, and as guesses beside springs of one number
(:func:`bha.estimation.scale.is_guessed`). One camera for all logs; one that is off by tens of degrees or mirrored is a
fault, see ``bha check``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.estimation.derived import Core, core_of, stiffness_elongations, tangent_stiffness
from bha.estimation.engine import Differences, Model
from bha.estimation.free import Coordinate, FreeParameter, camera_free, resolve, with_values
from bha.estimation.scale import DRAWN, is_guessed
from bha.parameters import Place, paths

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.parameters.sensors import SensorsParameters

Array = NDArray[np.float64]

#: Plausible relative distance of a plain parameter from the file's value, one standard deviation.
MASS_SPREAD, INERTIA_SPREAD, STIFFNESS_SPREAD, DAMPING_SPREAD, BENDING_SPREAD, AREA_SPREAD = (
    0.15,
    0.3,
    0.3,
    0.6,
    0.4,
    0.2,
)
#: The same of numbers that are guesses: off by factors of three, a bending stiffness by twice what it is or more.
GUESS, BENDING_GUESS = math.log(3.0), 2.0
#: Plausible distance of the centre of mass along z and of the rest length, as a share of the rest length.
CENTER_SPREAD, REST_SPREAD = 0.08, 0.05
#: Least rest length, as a share of the file's: a shorter arc stands for an arm that bends more towards its end.
LEAST_REST = 0.75
#: Least tangent stiffness, as a share of that at rest.
LEAST_STIFFNESS = 0.05
#: Differences large enough for effects that chatter; an arm has forgotten how it began after so long, s.
DIFFERENCES = Differences(parameter=1e-3, length=1e-4, rate=1e-3, moved=1e-2, memory=4.0, lenient=True)
#: Numbers of ``[sensors]`` that heads tell, with unit and from which distance to the file's value on they are said.
CAMERA = (("camera_position", "m", 1e-3), ("camera_rotation", "rad", 5e-3))

#: From so many times as far as a number plausibly is off, that is implausible.
IMPLAUSIBLE = 3.0


def coordinate(
    name: str,
    path: str,
    unit: str,
    nominal: float,
    spread: float,
    *,
    logarithmic: bool,
    low: float = -math.inf,
    high: float = math.inf,
    weight: float = 1.0,
) -> Coordinate:
    """A number that counts in the distances it plausibly has from its nominal value.

    Args:
        name: ``section 1 mass``, ``creep at bellows 32: tau``.
        path: where it stands in the core's description, or the name of an effect's number.
        unit: its unit.
        nominal: its value at x = 0.
        spread: one standard deviation of the prior, absolute, or of the logarithm.
        logarithmic: whether the value is ``nominal exp(spread x)``, else ``nominal + spread x``.
        low: least value.
        high: greatest value.
        weight: of the prior, 0 for none.
    """
    deviation = (nominal if logarithmic else 1.0) * spread * (weight**-0.5 if weight else math.inf)
    return Coordinate(name, path, unit, nominal, spread, logarithmic, low, high, nominal, deviation)


def of_sensors(coordinate: Coordinate) -> bool:
    """Whether a coordinate says how an arm is seen, not how it moves."""
    return paths.is_of_sensors(coordinate.path)


def of_camera(coordinate: Coordinate) -> bool:
    """Whether a coordinate says how heads are seen."""
    return coordinate.path.startswith("sensors.")


def of_wire(coordinate: Coordinate) -> bool:
    """Whether a coordinate says where a wire runs."""
    return coordinate.path.startswith("length_sensor.")


def is_damping(coordinate: Coordinate) -> bool:
    """Whether a plain coordinate is a damping."""
    return paths.key_of(coordinate.path) == "damping"


def plain_model(
    arm: Arm,
    *,
    camera: bool = False,
    wires: Sequence[FreeParameter] = (),
    more: Sequence[Coordinate] = (),
    identified: bool = False,
) -> Model:
    """The model of an arm with its plain parameters free, ``more`` beside them, then those of wires and of its camera.

    Args:
        arm: the arm.
        camera: whether the frame of the camera that sees its heads is free.
        wires: what is free of its wires, see :func:`bha.estimation.scale.wires_free`.
        more: further numbers that are free.
        identified: whether the arm's numbers are what logs have told, and no guesses whatever its file says.
    """
    core = core_of(arm.parameters)
    coordinates: list[Coordinate] = []
    for i, section in enumerate(core["section"]):
        guessed = is_guessed(arm.parameters.sections[i]) and not identified
        coordinates += _plain_of_section(arm, i, section, guessed=guessed)
    coordinates += more
    if wires:
        coordinates += [replace(own, scale=own.prior_deviation) for own in resolve(arm.parameters, wires)]
    if camera:
        coordinates += _of_the_camera(arm)
    return Model(arm.parameters, tuple(coordinates), differences=DIFFERENCES, remembers=True)


def _of_the_camera(arm: Arm) -> list[Coordinate]:
    """The frame of the camera that sees the heads; what the file calls published is known and stays."""
    found = []
    for own in resolve(arm.parameters, camera_free(arm.parameters)) if camera_free(arm.parameters) else ():
        _, key, axis = own.path.split(".")
        found.append(replace(own, name=f"{key} {axis}", scale=own.prior_deviation))
    return found


def sensors_at(model: Model, x: Array) -> SensorsParameters | None:
    """The sensors with the camera that is seen by at ``x``; None where no coordinate moves it."""
    moving = [(c, c.value(float(v))) for c, v in zip(model.plain, x, strict=False) if of_camera(c)]
    if not moving:
        return None
    return with_values(model.parameters, [c for c, _ in moving], [value for _, value in moving]).sensors


def said_of_camera(model: Model, uncertainty: Sequence[tuple[float, float]], x: Array) -> str | None:
    """What is to be said of a camera that is elsewhere than the file has it; None where it is not told to be.

    Args:
        model: the model.
        uncertainty: 95 % interval of each of its coordinates.
        x: its coordinates.
    """
    texts = []
    for key, unit, least in CAMERA:
        own = [(c, float(x[k]), uncertainty[k]) for k, c in enumerate(model.plain) if paths.key_of(c.path) == key]
        size = float(np.linalg.norm([c.value(v) - c.start for c, v, _ in own]))
        if size < least or all(low <= c.start <= high for c, _, (low, high) in own):
            continue
        how = f"stands {1e3 * size:.3g} mm beside" if unit == "m" else f"is turned by {np.degrees(size):.2g} deg from"
        values = ", ".join(f"{c.value(v):.4g}" for c, v, _ in own)
        texts.append(f"{how} where the file has it, {key} = [{values}]")
        if unit == "m" and size > IMPLAUSIBLE * max(c.prior_deviation for c, _, _ in own):
            texts[-1] += " (more than a camera is off: measure it; or the arm bends more towards its end than an arc)"
    return f"the camera that sees the heads {' and '.join(texts)}; estimated, no effect of the arm" if texts else None


def _plain_of_section(arm: Arm, i: int, section: Core, *, guessed: bool) -> list[Coordinate]:
    bellows = section["bellows"][0]
    place, path = Place.of_section(i + 1), f"section.{i + 1}"
    rest, stiffness = float(bellows["rest_length"]), [float(k) for k in bellows["stiffness"]]

    def scaled(key: str, unit: str, nominal: float, spread: float) -> Coordinate:
        return coordinate(f"{place} {key}", f"{path}.{key}", unit, nominal, spread, logarithmic=True)

    def guess(own: Coordinate) -> Coordinate:
        """A number that is off by factors where the section's are guesses."""
        return replace(own, prior_deviation=max(own.prior_deviation, GUESS * own.start)) if guessed else own

    found = [
        scaled("mass", "kg", float(section["mass"]), MASS_SPREAD),
        coordinate(f"{place} inertia factor", f"{path}.inertia.*", "1", 1.0, INERTIA_SPREAD, logarithmic=True),
        coordinate(
            f"{place} center_of_mass z",
            f"{path}.center_of_mass.z",
            "m",
            float(section["center_of_mass"][2]),
            CENTER_SPREAD * rest,
            logarithmic=False,
        ),
        *_rest_lengths(arm, i, section),
        guess(scaled("damping", "N s/m", max(float(bellows["damping"]), 1e-3), DAMPING_SPREAD)),
    ]
    first = stiffness[0] if stiffness[0] > 0.0 else 1.0
    for number, elongation in enumerate(stiffness_elongations(section), start=1):
        nominal = max(tangent_stiffness(stiffness, elongation), LEAST_STIFFNESS * first)
        name = f"{place} tangent stiffness at {1e3 * elongation:+.0f} mm"
        own = f"{path}.tangent_stiffness.{number}"
        found.append(guess(coordinate(name, own, "N/m", nominal, STIFFNESS_SPREAD, logarithmic=True)))
    bending = float(section["bending_stiffness"][0])
    # Where the file has none, a tenth of what the bellows' springs make of a bend.
    size = bending if bending > 0.0 else 0.15 * first * float(section["bellows_radius"]) ** 2
    bends = coordinate(
        f"{place} bending_stiffness",
        f"{path}.bending_stiffness.1",
        "N m",
        bending,
        BENDING_SPREAD * size,
        logarithmic=False,
        low=0.0,
    )
    found.append(replace(bends, prior_deviation=BENDING_GUESS * size) if guessed else bends)
    stated = arm.parameters.sections[i].provenance.get("terminal_area")
    if stated is None or stated.status == "assumed":
        spread = AREA_SPREAD if stated is not None else DRAWN
        found.append(guess(scaled("terminal_area", "m^2", float(bellows["terminal_area"]), spread)))
    return found


def _rest_lengths(arm: Arm, i: int, section: Core) -> list[Coordinate]:
    """One for all bellows of the section, or one each where the file states one for each."""
    stated = arm.parameters.sections[i].bellows
    lengths = [float(b["rest_length"]) for b in section["bellows"]]
    chosen = [(Place.of_section(i + 1), f"section.{i + 1}", lengths[0])]
    if stated is not None and all(bellows.rest_length is not None for bellows in stated):
        chosen = [
            (Place.of_bellows(i + 1, k), f"section.{i + 1}.bellows.{k}", rest)
            for k, rest in enumerate(lengths, start=1)
        ]
    return [
        coordinate(
            f"{place} rest_length",
            f"{path}.rest_length",
            "m",
            rest,
            REST_SPREAD * rest,
            logarithmic=False,
            low=LEAST_REST * rest,
        )
        for place, path, rest in chosen
    ]
