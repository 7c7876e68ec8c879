"""What is particular to a log: the session it was measured in, and known changes of the arm.

A change is a number of the file that was another one while a log was measured (gravity or the base's pose in another
mounting), or a payload: ``section.3.payload`` is a point mass, kg, at the centre of that section's head, and
``section.3.payload.x``, ``.y``, ``.z`` say where else in the head's frame it hangs, m. What is known differs from what
is estimated: a number cannot be both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from bha.errors import InputError, ParameterError
from bha.estimation.free import Coordinate
from bha.parameters import ArmParameters, paths

_PAYLOAD = re.compile(r"section\.(\d+)\.payload(?:\.([xyz]))?")


@dataclass(frozen=True)
class Condition:
    """Session and known changes of a log.

    Attributes:
        session: its name; logs of one session share the numbers that are estimated session by session.
        changes: paths and their numbers, see above, in the order of their paths.
    """

    session: str = ""
    changes: tuple[tuple[str, float], ...] = ()

    def applied(self, parameters: ArmParameters) -> ArmParameters:
        """The parameters with the changes.

        Raises:
            ParameterError: a path the arm does not have, or a value that is not allowed.
            InputError: a payload's place without a payload.
        """
        if not self.changes:
            return parameters
        values = {path: value for path, value in self.changes if not _PAYLOAD.fullmatch(path)}
        changed = paths.with_values(parameters, values)
        payloads = _payloads(dict(self.changes), len(parameters.sections))
        if not payloads:
            return changed
        mapping = changed.to_mapping()
        return changed.updated({"effect": [*mapping.get("effect", []), *payloads]})

    def in_words(self) -> str:
        """``section.3.payload = 0.2``, joined by commas; empty without changes."""
        return ", ".join(f"{path} = {value:g}" for path, value in self.changes)


def changes_of(changes: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Changes as a condition has them.

    Raises:
        InputError: something that is no finite number.
    """
    for path, value in changes.items():
        if not math.isfinite(value):
            raise InputError(f"{path} = {value}: a finite number is needed")
    return tuple(sorted((path, float(value)) for path, value in changes.items()))


def conditioned(parameters: ArmParameters, conditions: Iterable[Condition]) -> dict[Condition, ArmParameters]:
    """The parameters under each of some conditions."""
    return {condition: condition.applied(parameters) for condition in dict.fromkeys(conditions)}


def check_apart(coordinates: Sequence[Coordinate], conditions: Iterable[Condition]) -> None:
    """What is known of a log must not be estimated from it.

    Raises:
        InputError: it is.
    """
    for condition in conditions:
        for coordinate in coordinates:
            if coordinate.sessions and condition.session not in coordinate.sessions:
                continue
            for path, value in condition.changes:
                if path in coordinate.members:
                    raise InputError(
                        f"{path} is free (as {coordinate.name}) and known for a log ({value:g}); allowed: one of both. "
                        "Leave it out of what is free, or do not state it; a mass that was added is section.N.payload"
                    )


def _payloads(changes: Mapping[str, float], count: int) -> list[dict[str, object]]:
    """Effects that the changes stand for, section by section."""
    found: dict[int, dict[str, object]] = {}
    for path, value in changes.items():
        match = _PAYLOAD.fullmatch(path)
        if match is None:
            continue
        section = int(match[1])
        if not 1 <= section <= count:
            raise ParameterError(f"{path}: the arm has sections 1 to {count}")
        found.setdefault(section, {"kind": "payload", "where": f"section {section}"})[match[2] or "mass"] = value
    for section, effect in found.items():
        if "mass" not in effect:
            raise InputError(
                f"section.{section}.payload: its place is given and its mass is not; give section.{section}.payload, kg"
            )
    return [found[section] for section in sorted(found)]
