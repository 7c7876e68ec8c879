"""What is free beyond the defaults where logs ask for it: curved springs, chambers that are not alike, what creeps.

Nearly every arm is a little of both, but a number that logs do not need takes part in every combination that they do
not tell. These are therefore tried only where the defaults leave more than the noise, and kept where simulations from
the new start leave clearly less (:mod:`bha.estimation.begin`):

- second and third powers of springs of which the file states one number;
- gains of single inputs (areas of their chambers, sensors, regulators: they act alike) and azimuths of single chambers;
- preloads of the sections, log by log, told by where each log begins (:mod:`bha.estimation.preload`), and with them
  areas that change with the length of a chamber, as those of fabric do.

Offsets of single inputs and rest lengths of single chambers hold the arm bent, as a turned camera shows it: with heads
alone they are not told from it and are not tried.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from bha.estimation.free import FreeParameter
from bha.estimation.preload import with_preloads
from bha.estimation.scale import curved
from bha.estimation.statics import TURN
from bha.parameters import ArmParameters, paths
from bha.recordings.beginning import KIND as PRELOAD

#: Standard deviations of what chambers differ by: gain, and azimuth in rad.
GAIN, AZIMUTH = 0.1, math.radians(5.0)
AREA = "effective_area"
#: Powers of a spring that is curved.
POWERS = 3
#: Standard deviation of what an area changes by in itself for each metre of length: a seventh for a centimetre.
BY_LENGTH = 15.0


@dataclass(frozen=True)
class Asked:
    """Parameters with more of them free.

    Attributes:
        parameters: the arm, with the effects that stand for what is new.
        free: all that is free.
        said: what was added, in words.
        static: whether it acts on held poses, so that these must be better with it too.
        begins: whether it says where logs begin, so that simulations of whole logs must be better with it.
        carries: whether it may fit what other motions do not have, so that held poses of logs left out of the statics
            must be better with it.
    """

    parameters: ArmParameters
    free: tuple[FreeParameter | str, ...]
    said: str
    static: bool
    begins: bool = False
    carries: bool = False


def curved_springs(parameters: ArmParameters, free: Sequence[FreeParameter | str]) -> Asked | None:
    """Springs of three powers where the file states one number that is free; None where it does so of no section.

    A tape measure's file says how stiff a chamber is, not that it is as stiff at the ends of its range as at rest.
    """
    names = {f if isinstance(f, str) else f.path for f in free}
    mapping, more = parameters.to_mapping(), []
    for number, section in enumerate(parameters.sections, start=1):
        if len(section.stiffness) > 1 or f"section.{number}.stiffness.1" not in names:
            continue
        mapping["section"][number - 1]["stiffness"] = [section.stiffness[0], *[0.0] * (POWERS - 1)]
        more += [f"section.{number}.stiffness.{power}" for power in range(2, POWERS + 1)]
    if not more:
        return None
    changed = parameters.updated({"section": mapping["section"]})
    said = "springs are not as stiff at the ends of their range as at rest: second and third powers were added"
    # What held poses tell is blurred by the form of their lags, by more than a spring's curve.
    return Asked(changed, (*free, *(curved(changed, path) for path in more)), said, False)


def material_that_creeps(parameters: ArmParameters, free: Sequence[FreeParameter | str]) -> Asked | None:
    """Preloads told by first poses, and areas that change with length; None where the arm has some of them already.

    What holds an arm off by as much in all its poses is no longer free beside them, nor is the scale of its areas; its
    springs are about the file's again, within a factor of five: where areas fall, an arm with weak springs buckles.
    """
    if any(effect.kind in (PRELOAD, AREA) for effect in parameters.effects):
        return None
    mapping = parameters.to_mapping()
    effects, more, prior = list(mapping.get("effect", [])), [], (0.0, BY_LENGTH)
    for number in range(1, len(parameters.sections) + 1):
        effects.append({"kind": AREA, "where": f"section {number}", "by_length": 0.0})
        slope = FreeParameter(f"effect.{len(effects)}.by_length", prior=prior, logarithmic=False, scale=BY_LENGTH)
        more.append(replace(slope, lower=-3.0 * BY_LENGTH, upper=BY_LENGTH))
    left = [_plainly(f) for f in free if not _holds_off(f if isinstance(f, str) else f.path)]
    said = (
        "logs begin at rest in other poses than their pressures say: what holds the arm there is told by each log's "
        "first pose (effect preload; what is written is its mean), and areas change with length (effect effective_area)"
    )
    changed = with_preloads(parameters.updated({**mapping, "effect": effects}))
    return Asked(changed, (*left, *more), said, True, begins=True)


def _plainly(free: FreeParameter | str) -> FreeParameter | str:
    """The same, springs with the prior of a guess."""
    path = free if isinstance(free, str) else free.path
    key = paths.key_of(path)
    if key not in ("stiffness", "bending_stiffness") or not path.endswith(".1"):
        return free
    sessions = () if isinstance(free, str) else free.sessions
    return FreeParameter(path, sessions, lower=1e-3)


def _holds_off(path: str) -> bool:
    """Whether a number moves or tilts the whole arm (rest length, centre of mass, camera), or is the scale of areas."""
    if paths.is_of_sensors(path):
        return path != TURN
    return paths.key_of(path) in ("rest_length", "center_of_mass", "terminal_area")


def unlike_chambers(parameters: ArmParameters, free: Sequence[FreeParameter | str]) -> Asked | None:
    """Gains of all inputs and azimuths of all chambers free; None where inputs have gains already.

    The arm's first chamber keeps its azimuth where the camera's turn is free: all azimuths together are this turn.
    """
    if any(effect.kind == "pressure_gain" for effect in parameters.effects):
        return None
    turns = TURN in {f if isinstance(f, str) else f.path for f in free}
    mapping = parameters.to_mapping()
    effects, more = list(mapping.get("effect", [])), []
    for name in parameters.inputs:
        effects.append({"kind": "pressure_gain", "where": f"input {name}", "gain": 0.0})
        path = f"effect.{len(effects)}.gain"
        more.append(FreeParameter(path, lower=-0.5, upper=1.0, prior=(0.0, GAIN), logarithmic=False, scale=GAIN))
    for number, section in enumerate(parameters.sections, start=1):
        if section.bellows is None:
            continue
        for k, bellows in enumerate(section.resolved_bellows(number), start=1):
            path = f"section.{number}.bellows.{k}.angle"
            if turns and (number, k) == (1, 1):
                continue
            more.append(FreeParameter(path, prior=(bellows.angle, AZIMUTH), logarithmic=False, scale=AZIMUTH))
    said = "chambers are not alike: gains of inputs (effect pressure_gain) and azimuths of chambers were added"
    return Asked(parameters.updated({**mapping, "effect": effects}), (*free, *more), said, True, carries=True)
