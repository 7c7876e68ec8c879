"""Section IV of the paper in its order, from anybody's logs: stiffness, then bending stiffness, then damping.

Each procedure takes from the arm's file what the ones before it have found and gives back the file with its own
numbers. What its logs must hold is in ``NEEDS``; moments of inertia (IV-B) need no log
(:mod:`bha.identification.moments`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.records import Record, record
from bha.identification.provenance import Mark, marked
from bha.identification.stiffness import StiffnessFit, bending_stiffness, longitudinal_stiffness
from bha.identification.swing import SwingFit, swing_damping
from bha.logs import Log
from bha.parameters import ArmParameters, paths
from bha.recordings import PressureSort, Recording, recordings

ProcedureName = Literal["stiffness", "bending", "damping"]
#: In the paper's order.
PROCEDURES: tuple[ProcedureName, ...] = get_args(ProcedureName)
#: What the logs of each must hold.
NEEDS: dict[ProcedureName, str] = {
    "stiffness": "all bellows of a section inflated evenly, in steps that are held for a second or more, up and down",
    "bending": "bellows 2 and 3 of a section evenly against bellows 1, in steps to either side that are held",
    "damping": "free swings of some seconds under constant pressures, after a hand or a thread lets the arm go",
}


@dataclass(frozen=True)
class Procedure:
    """The result of one procedure.

    Attributes:
        name: ``"stiffness"`` (Fig. 8), ``"bending"`` (Fig. 9) or ``"damping"`` (Fig. 10).
        start: the arm it started from.
        arm: the arm with what was found.
        laws: the fitted law of each section, for stiffness and bending.
        swing: the fitted swings, for damping.
        records: the logs.
    """

    name: ProcedureName
    start: Arm
    arm: Arm
    laws: tuple[StiffnessFit, ...]
    swing: SwingFit | None
    records: tuple[Record, ...]

    @property
    def found(self) -> dict[str, tuple[float, float]]:
        """Estimate and standard error of each number by its path."""
        if self.swing is not None:
            return self.swing.damping
        entries: dict[str, tuple[float, float]] = {}
        for law in self.laws:
            entries |= law.entries
            if law.rest_shift is not None:
                path = f"section.{law.section}.rest_length"
                entries[path] = (paths.get_value(self.arm.parameters, path), law.rest_shift[1])
        return entries

    def before(self, path: str) -> float | None:
        """What the arm it started from had at a path; None for nothing."""
        return paths.get_value(self.start.parameters, path) if path in paths.available(self.start.parameters) else None

    def parameters(self) -> ArmParameters:
        """The parameters with what was found, with intervals and the logs' hashes."""
        marks = [Mark.of_error(path, *entry, self.records) for path, entry in self.found.items()]
        return marked(self.arm.parameters, marks)

    def summary(self) -> dict[str, Any]:
        """Everything as plain values, for JSON."""
        found = {
            "arm": self.start.name,
            "procedure": self.name,
            "parameters": [
                {"path": path, "unit": paths.unit_of(path), "value": value, "standard_error": error}
                for path, (value, error) in self.found.items()
            ],
        }
        if self.swing is not None:
            pairs = zip(self.swing.used, self.swing.measured, self.swing.modelled, strict=True)
            return found | {
                "swings": [
                    {
                        "stretch": vars(stretch),
                        "frequency": seen.frequency,
                        "damping_ratio": seen.damping_ratio,
                        "amplitude": seen.amplitude,
                        "left": seen.residual,
                        "model_frequency": model.frequency,
                        "model_damping_ratio": model.damping_ratio,
                    }
                    for stretch, seen, model in pairs
                ]
            }
        return found | {
            "laws": [
                {
                    "section": law.section,
                    "abscissa": law.abscissa,
                    "ordinate": law.ordinate,
                    "residual": law.residual,
                    "rest_length": law.rest_length,
                    "offset": law.offset,
                    "drift": law.drift,
                    "used": [vars(stretch) for stretch in law.used],
                }
                for law in self.laws
            ]
        }


def carry_out(
    arm: Arm,
    logs: Sequence[Log | Recording | Record],
    name: ProcedureName,
    *,
    sections: Sequence[int] | None = None,
    order: int = 3,
    pressures: PressureSort | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Procedure:
    """One procedure of section IV on some logs.

    Args:
        arm: what is known before: geometry and masses; for bending the stiffness, for damping both.
        logs: see ``NEEDS``.
        name: which.
        sections: numbers of the sections whose law is found; all if None. Damping is found for all at once.
        order: of the spring force curve.
        pressures: which pressures of the logs count, ``"measured"`` or ``"commanded"``.
        progress: called with what is being done and the fraction done.

    Raises:
        InputError: the logs lack what the procedure needs of some section, or an argument that is not allowed.
        LogError: a log lacks a pressure of the arm.
        ConvergenceError: no damping lets the model swing as the arm does.
    """
    if name not in PROCEDURES:
        raise InputError(f"procedure: {name!r}; allowed: {', '.join(PROCEDURES)}")
    if not logs:
        raise InputError(f"there is no log; the procedure {name!r} needs {NEEDS[name]}")
    others = [item for item in logs if not isinstance(item, Record)]
    made = iter([record(arm, item) for item in recordings(arm, others, pressures=pressures)] if others else [])
    records = tuple(item if isinstance(item, Record) else next(made) for item in logs)
    every = range(1, arm.section_count + 1)
    chosen = list(every) if sections is None else sorted(set(sections))
    if wrong := [k for k in chosen if k not in every]:
        raise InputError(f"section {wrong[0]}: {arm.name} has sections 1 to {arm.section_count}")
    if name == "damping":
        if sections is not None:
            raise InputError("one swing gives one number for all sections: damping takes no choice of sections")
        swing = swing_damping(arm, records, progress=progress)
        return Procedure(name, arm, swing.applied(arm), (), swing, records)
    laws: list[StiffnessFit] = []
    found = arm
    for done, section in enumerate(reversed(chosen)):  # from the tip down: what is above pushes on what is below
        if progress is not None:
            progress(f"section {section}", done / len(chosen))
        if name == "stiffness":
            laws.append(longitudinal_stiffness(found, records, section, order=order))
        else:
            laws.append(bending_stiffness(found, records, section))
        found = laws[-1].applied(found)
    return Procedure(name, arm, found, tuple(laws[::-1]), None, records)
