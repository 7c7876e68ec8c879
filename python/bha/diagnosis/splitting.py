"""The next experiment as pressures: what would split a class that the logs leave open.

What: arms that have one member of the class each are simulated under many programmes of pressures
(:mod:`bha.estimation.programme`). Between two of them counts what is left of their difference in the measured outputs,
over noise, after all that could be refitted has taken what it can: the usual parameters of the arm and the strengths of
both members, linearly. Its norm is how many standard deviations apart the two would be found. The programme whose worst
pair is furthest apart is proposed.
Validity: noise that is white at the rows of the simulation; members whose numbers are those of a refit, or of the
screening. What the model lacks beside them is not in it: double the distance that is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import BhaError, ParameterError
from bha.estimation.free import apply, default_free, resolve
from bha.estimation.programme import KINDS, Programme, bounded, commands
from bha.logs import Log
from bha.parameters import EFFECT_KINDS
from bha.runs.input import Input
from bha.simulation import simulate_batch

if TYPE_CHECKING:
    from bha.diagnosis.result import Diagnosis, Effect
    from bha.estimation.runs import Integration
    from bha.recordings import Observation

Array = NDArray[np.float64]

#: Standard deviations from which on two members count as told apart: twice the usual three, since no model is right.
TOLD = 6.0
#: Members of a class that are set apart, at the most: the likeliest.
MOST_MEMBERS = 4
#: Programmes that are looked into, of those under which the members differ most.
MOST_PROGRAMMES = 4
#: Length of a programme, s, and rows a second that are compared.
DURATION, RATE, ROWS = 30.0, 100.0, 25.0
#: Relative change for differences.
CHANGE = 1e-3


@dataclass(frozen=True)
class Splitting:
    """Pressures that would split a class.

    Attributes:
        time: s, shape (m,).
        pressures: commanded, Pa absolute, shape (m, inputs).
        inputs: names of the inputs.
        members: what is set apart, ``kind at where``.
        distance: of the worst pair, in standard deviations.
        splits: whether that is enough.
    """

    time: Array
    pressures: Array
    inputs: tuple[str, ...]
    members: tuple[str, ...]
    distance: float

    @property
    def splits(self) -> bool:
        """Whether the worst pair would be told apart."""
        return self.distance >= TOLD

    def log(self) -> Log:
        """The commanded pressures as a log (``pc11 [Pa]``, ...)."""
        return commands(self.time, self.pressures, self.inputs, origin="<next experiment>")


def split(
    arm: Arm, found: Diagnosis, observation: Observation, seed: int = 0, integration: Integration | None = None
) -> Splitting | None:
    """Pressures that would split the first class of a diagnosis; None where there is none that can be simulated.

    What the members do under a programme costs little beside what plain numbers make up for; that is asked of the few
    programmes under which they differ most.

    Args:
        arm: the diagnosed arm, with all that was named as its last effects.
        found: the diagnosis.
        observation: what is measured of the arm.
        seed: of the programmes.
        integration: of its model; with adaptive steps if None.
    """
    # Pressures alone never split lag from damping: near a pose the two change places and nothing shows.
    effect = next((e for e in found.missing if e.one_of and not e.slow), None)
    if effect is None:
        return None
    members = arms_of_class(arm, effect)
    if len(members) < 2:
        return None
    arms, shown = [a for _, a in members], Shown(observation, found.gap.noise, integration)
    made = [own for programme in _programmes(seed) if (own := bounded(arm, programme)) is not None]
    differ = [nearest(shown.of(arms, *own)) for own in made]
    best: Splitting | None = None
    for k in np.argsort([-d if np.isfinite(d) else np.inf for d in differ], kind="stable")[:MOST_PROGRAMMES]:
        time, pressures = made[k]
        distance = apart(arms, time, pressures, shown)
        if np.isfinite(distance) and (best is None or distance > best.distance):
            best = Splitting(time, pressures, arm.inputs, tuple(name for name, _ in members), float(distance))
    return best


@dataclass(frozen=True)
class Shown:
    """How arms are shown.

    Attributes:
        observation: what is measured of them.
        noise: RMS error of a right model, m.
        integration: how they are simulated; with adaptive steps if None.
    """

    observation: Observation
    noise: float
    integration: Integration | None = None

    def of(self, arms: Sequence[Arm], time: Array, pressures: Array) -> Array | None:
        """Outputs of arms in noises, one row each, under pressures from where they stand; None where one diverges."""
        how: dict[str, Any] = {}
        if self.integration is not None:
            how = {"method": self.integration.method, "step": self.integration.length()}
            how["threads"] = self.integration.threads
        try:
            starts = [np.concatenate([a.static_lengths(pressures[0]), np.zeros(3 * a.section_count)]) for a in arms]
            batch = simulate_batch(
                arms,
                Input(time, pressures),
                np.array(starts),
                times=np.arange(0.0, time[-1], 1.0 / ROWS),
                head_positions=self.observation.needs_positions,
                measured=True,
                warn=False,
                **how,
            )
        except BhaError:
            return None
        if any(batch.failures):
            return None
        predicted = self.observation.predicted(batch.lengths, batch.head_positions)
        return np.asarray(predicted.reshape(len(arms), -1) / self.noise)


def nearest(outputs: Array | None, without: Array | None = None) -> float:
    """How far apart the nearest two rows are, beyond orthonormal directions (numbers, k); NaN where there are none."""
    if outputs is None:
        return float("nan")
    differences = [a - b for a, b in combinations(outputs, 2)]
    if without is not None:
        differences = [own - without @ (without.T @ own) for own in differences]
    return float(min(np.linalg.norm(own) for own in differences))


def arms_of_class(arm: Arm, effect: Effect) -> list[tuple[str, Arm]]:
    """An arm a member of the class of ``effect``, which ``arm`` has; with its name. None of what no arm can have."""
    effects = list(arm.parameters.effects)
    place = next((k for k, e in enumerate(effects) if (e.kind, e.where) == (effect.kind, effect.where)), None)
    if place is None:
        return []
    others = [*effects[:place], *effects[place + 1 :]]
    members = [(f"{effect.kind} at {effect.where}", arm.with_effects([*others, effects[place]]))]
    for other in effect.one_of[: MOST_MEMBERS - 1]:
        numbers = {name: n.value for name, n in other.parameters.items()}
        if not numbers and EFFECT_KINDS[other.kind].parameters:
            continue
        table = {"kind": other.kind, "where": other.where, **numbers}
        with suppress(ParameterError):
            members.append((f"{other.kind} at {other.where}", arm.with_effects([*others, table])))
    return members


def apart(members: Sequence[Arm], time: Array, pressures: Array, shown: Shown) -> float:
    """How far apart the nearest two of the arms would be found, in standard deviations; NaN where one diverges.

    Beyond what other plain numbers of the first one, and other numbers of the last effect of each, would make up for.
    """
    try:
        coordinates = resolve(members[0].parameters, default_free(members[0].parameters))
        steps = CHANGE * np.eye(len(coordinates))
        varied = [Arm(apply(members[0].parameters, coordinates, step)) for step in steps]
    except BhaError:
        return float("nan")
    stronger = [_stronger(member) for member in members]
    outputs = shown.of([*members, *varied, *(arm for arms in stronger for arm in arms)], time, pressures)
    if outputs is None:
        return float("nan")
    base, changed = outputs[: len(members)], outputs[len(members) :]
    beside = np.repeat([0, *range(len(members))], [len(varied), *map(len, stronger)])
    taken = (changed - base[beside]).T
    taken = taken / np.maximum(np.linalg.norm(taken, axis=0), 1e-300)
    orthonormal, triangle = np.linalg.qr(taken)
    return nearest(base, orthonormal[:, np.abs(np.diag(triangle)) > 1e-9])


def _stronger(arm: Arm) -> list[Arm]:
    """The arm with each number of its last effect, but zeros, a little greater, or less where it is on its bound."""
    effects = list(arm.parameters.effects)
    last, made = effects[-1], []
    for name, value in last.parameters.items():
        if not value:
            continue
        for factor in (1.0 + CHANGE, 1.0 - CHANGE):
            table = {"kind": last.kind, "where": last.where, **last.parameters, name: value * factor}
            try:
                made.append(arm.with_effects([*effects[:-1], table]))
            except ParameterError:
                continue
            break
    return made


def _programmes(seed: int) -> list[Programme]:
    """What is tried: every sort of piece alone and all together, small and large, slow and fast."""
    sorts = [(kind,) for kind in KINDS] + [KINDS]
    tried = [
        Programme(kinds, amplitude, highest, DURATION, RATE, seed + k)
        for k, (kinds, amplitude, highest) in enumerate(
            (kinds, amplitude, highest)
            for kinds in sorts
            for amplitude in (0.4, 0.8)
            for highest in ((1.0, 3.0) if "multisine" in kinds else (3.0,))
        )
    ]
    return tried
