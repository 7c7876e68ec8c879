"""Repairs that can be made by machine: what a finding says to change, made on the logs in memory and on the arm.

What: a :class:`Mend` is the line of an :class:`Explanation` as data. Of a class of mistakes that act alike the first is
taken: the logs cannot tell its members apart, so none of them is told apart by what follows either. Nothing is written.
Limits: a log at fault alone whose repair would be another arm file, and mistakes whose size is not known (an excursion
out of a range, one of several units) are left; so is what comes back after it was mended.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.logs import Log


@dataclass(frozen=True)
class Mend:
    """What to change.

    Attributes:
        renames: column of a log -> the name that it should have.
        factors: column of a log -> what its values are multiplied with, in SI units.
        gauge: whether the columns of ``pressures`` are gauge pressures; None leaves them as they are.
        pressures: columns of pressures that ``gauge`` speaks of.
        arm: tables and keys of the arm's file that are replaced: ``sensors``, ``gravity``.
        angles: section, from 0 -> angle of each of its bellows, deg.
    """

    renames: Mapping[str, str] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)
    gauge: bool | None = None
    pressures: tuple[str, ...] = ()
    arm: Mapping[str, Any] = field(default_factory=dict)
    angles: Mapping[int, tuple[float, ...]] = field(default_factory=dict)

    @property
    def of_log(self) -> bool:
        """Whether it changes logs, and not the arm."""
        return bool(self.renames or self.factors or self.gauge is not None)


def mended_log(log: Log, mend: Mend) -> Log:
    """The log with the names, units and sort of pressure that it should have had; path and hash stay."""
    return log.restated(mend.renames, mend.factors, dict.fromkeys(mend.pressures, mend.gauge))


def mended_arm(arm: Arm, mend: Mend) -> Arm:
    """The arm as its file should have been."""
    mapping = arm.parameters.to_mapping()
    changes: dict[str, Any] = {
        key: _changed(mapping.get(key, {}), value) if isinstance(value, Mapping) else value
        for key, value in mend.arm.items()
    }
    if mend.angles:
        sections = [dict(section) for section in mapping["section"]]
        for i, angles in mend.angles.items():
            tables = sections[i].get("bellows") or [{} for _ in angles]
            sections[i]["bellows"] = [
                _changed(table, {"angle_deg": angle}) for table, angle in zip(tables, angles, strict=True)
            ]
        changes["section"] = sections
    return arm.with_parameters(arm.parameters.updated(changes))


def _changed(table: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """A table with other values, assumed ones: what it had under the same name, in whatever unit, is gone."""
    gone = {form for name in values for form in (name, f"{name}_deg", name.removesuffix("_deg"))}
    kept = {name: value for name, value in table.items() if name not in gone}
    if provenance := {k: v for k, v in kept.pop("provenance", {}).items() if k not in gone}:
        kept["provenance"] = provenance
    return {**kept, **values}


def in_words(what: str, alike: Sequence[str], where: str) -> str:
    """What was mended, in a sentence."""
    of = "" if where == "arm file" else f"{where}: "
    also = f" (as far as these logs tell it may as well be: {'; or '.join(alike)})" if alike else ""
    return f"repaired, {of}{what}{also}"
