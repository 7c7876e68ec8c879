"""An arm and a log put together: the one way from measured data into the model.

Every command and every call that takes a log makes a :class:`Recording` of it, so that all of them read it alike: which
pressures drive the arm and how they act, what the log measures of it and where, what each sample is worth.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError, LogWarning
from bha.logs import Log
from bha.recordings import clock, compare, ranges, samples, stairs, unused
from bha.recordings.pressures import PressureSort
from bha.recordings.readings import Readings
from bha.recordings.samples import ChannelFacts
from bha.support.shown import html_table

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Recording(Readings):
    """One log as one arm sees it; m rows, C outputs. Immutable.

    Attributes:
        arm: the arm as its file says.
        acting: the arm that ``drive`` drives: without pneumatics where pressures are measured in the chambers.
        log: the log, gauge pressures relative to the arm's ambient pressure.
        name: what it is called in reports.
        clock: what is known of its times.
        time: of its rows, s, shape (m,); even again where a coarse timer had stamped them.
        pressures: which pressures drive the arm, and how.
        drive: pressures and forces as the model takes them.
        drive_rows: for each row of the log its sample of ``drive``, shape (m,).
        observation: the outputs as functions of coordinates and heads.
        measured: values of the outputs, SI, shape (m, C); NaN where missing.
        usable: which of them are readings that count, shape (m, C).
        facts: of the outputs.
        pressure_facts: of the inputs.
        findings: what is to be warned of in this log with this arm, a text each.
    """

    def __init__(
        self,
        arm: Arm,
        log: Log | str | os.PathLike[str],
        *,
        pressures: PressureSort | None = None,
        missing: bool = False,
        mapping: str | os.PathLike[str] | None = None,
        name: str | None = None,
        warn: bool = True,
    ) -> None:
        """Put an arm and a log together.

        Args:
            arm: the arm.
            log: a log, or the path of one.
            pressures: ``"measured"`` or ``"commanded"`` ones drive the arm; if None measured ones where the log has
                them, else commanded ones.
            missing: with a path: take NaN and empty cells of measured outputs as missing samples.
            mapping: with a path: a mapping file, as for :meth:`bha.Log.read`.
            name: what to call it; the file's name if None.
            warn: whether to warn of the findings.

        Raises:
            LogError: the log cannot be read, lacks a pressure of the arm, or has a name that the arm's layout
                contradicts.
            InputError: an argument that is not allowed.

        Warns:
            LogWarning: each of the findings.
        """
        super().__init__(arm, log, pressures=pressures, missing=missing, mapping=mapping, name=name)
        self._judge_together()
        self.findings = tuple(self._found())
        if warn:
            for text in self.findings:
                warnings.warn(f"{self.name}: {text}", LogWarning, stacklevel=2)

    def _judge_together(self) -> None:
        """Pressures that are frozen, or held as they act, show only beside the outputs."""
        self._stairs: stairs.Stairs | None = None
        if self.pressures.sort == "commanded" or not self.outputs:
            return
        alone = self.usable.copy()
        self._leave_out_unknown()
        self._stairs = stairs.stairs(self)
        if self._stairs is None or not self._stairs.act:
            return
        # They are as good as commands: what stands still is no dropout, what jumps no spike and no noise.
        choice = replace(self.pressures, between_readings="steps", between_samples=self._stairs.rise)
        self.pressures, self.usable = choice, alone
        judged = [
            samples.judge(self.time, n, "Pa", self._raw[:, k], measured=False) for k, n in enumerate(choice.columns)
        ]
        self.pressure_facts = tuple(fact for fact, _ in judged)
        self._pressure_usable = np.column_stack([m for _, m in judged])
        self._leave_out_unknown()

    def _found(self) -> list[str]:
        said = list(self._said)
        names_used = {*self.log.gauge_columns, *self.observation.names, *self.pressures.columns}
        if text := unused.unused(self.log, names_used):
            said.append(text)
        if text := clock.doubt(self.clock, float(self.time[0]), measured=bool(self.outputs)):
            said.append(text)
        said += ranges.outside(self)
        return said

    @property
    def notes(self) -> tuple[str, ...]:
        """How the file was read, and what was done about samples that are no readings, a text each."""
        said = list(self.log.notes)
        if self.clock.tick > 0.0:
            tick = f"{1e3 * self.clock.tick:.3g} ms"
            said.append(f"rows were stamped by a timer of {tick}; they are taken as even, {_rate(self.clock)}")
        if self.clock.scatter > 0.0:
            scatter = f"{1e3 * self.clock.scatter:.2g} ms (standard deviation)"
            said.append(f"stamps of rows scatter by {scatter}; they are smoother as even ones, {_rate(self.clock)}")
        if self._stairs is not None and self._stairs.act:
            said.append(self._stairs.in_words())
        curve = "the curve between its readings drives"
        if self._stairs is not None and not self._stairs.told:
            curve += " (or steps might: the outputs do not tell them apart)"
        for fact, verb in (
            *((f, curve) for f in self.pressure_facts),
            *((f, "its repeats do not count") for f in self.facts),
        ):
            if fact.filled:
                between = f"{fact.name} is filled in by straight lines between readings every {fact.interval:.3g} s"
                said.append(f"{between}: {verb.replace('its repeats do', 'what lies between does')}")
            elif fact.held > 0.0:
                said.append(f"{fact.name} renews every {fact.interval:.3g} s: {verb}")
            if fact.frozen:
                said.append(f"{fact.name} is frozen {self._spans(fact.frozen)}: what the arm does then does not count")
            if fact.dropouts:
                said.append(f"{fact.name} stands still {self._spans(fact.dropouts)}: left out")
            if fact.spikes:
                many = f"{len(fact.spikes)} reading{'s' * (len(fact.spikes) != 1)}"
                at = ranges.moment(fact.spikes[0], float(self.time[0]))
                said.append(f"{fact.name} jumps in {many}, the first at {at}: left out")
            if fact.missing > 0.0:
                said.append(f"{fact.name} is missing in {100.0 * fact.missing:.3g} % of the rows")
        return tuple(said)

    def _spans(self, spans: Sequence[tuple[float, float]]) -> str:
        return ranges.stretches(spans, float(self.time[0]))

    def errors(self, trajectory: Trajectory) -> Array:
        """Simulated minus measured outputs at the rows of a trajectory of this drive, shape (rows, C).

        NaN where nothing was measured: outside of the log, in dropouts, where a reading does not count.
        """
        return compare.errors(self, trajectory)

    def as_trajectory(self) -> Trajectory:
        """What was measured as a trajectory, NaN where it was not: to be drawn beside a simulated one."""
        return compare.as_trajectory(self)

    def __eq__(self, other: object) -> bool:
        """Whether arm, log and what was decided are equal."""
        if not isinstance(other, Recording):
            return NotImplemented
        return (self.arm, self.log, self.name, self.pressures) == (other.arm, other.log, other.name, other.pressures)

    __hash__ = None  # type: ignore[assignment]

    def to_mapping(self) -> dict[str, Any]:
        """What was decided and found, for JSON."""
        return {
            "log": self.name,
            "arm": self.arm.name,
            "sha256": self.log.sha256,
            "clock": asdict(self.clock),
            "pressures": self.pressures.to_mapping(),
            "outputs": [
                {**asdict(output), **asdict(fact), "usable": float(np.mean(self.usable[:, k]))}
                for k, (output, fact) in enumerate(zip(self.outputs, self.facts, strict=True))
            ],
            "inputs": [asdict(fact) for fact in self.pressure_facts],
            "notes": list(self.notes),
            "findings": list(self.findings),
        }

    def to_json(self) -> str:
        """:meth:`to_mapping` as text."""
        return json.dumps(self.to_mapping())

    def __repr__(self) -> str:
        """Log, arm, pressures and outputs in one line."""
        outputs = ", ".join(self.channels[:6]) + (", ..." if len(self.channels) > 6 else "")
        return (
            f"<Recording {self.name} of {self.arm.name!r}: {len(self)} rows, {self.clock.duration:g} s, "
            f"{self.pressures.sort} pressures, outputs {outputs or 'none'}>"
        )

    def _repr_html_(self) -> str:
        """What is known of its channels, for notebooks."""
        rows = [
            (fact.name, fact.unit, fact.noise or None, fact.quantum or None, fact.interval, fact.missing or None)
            for fact in (*self.pressure_facts, *self.facts)
        ]
        headings = ("channel", "unit", "noise", "steps of", "interval [s]", "missing, share")
        notes = [*self.notes, *(f"warning: {text}" for text in self.findings)]
        return html_table(repr(self), headings, rows, notes=notes)

    def __str__(self) -> str:
        """What was decided and found, in a few lines."""
        choice = self.pressures
        between = "held between changes" if choice.between_samples == "hold" else "linear between samples"
        if any(fact.curved for fact in self.pressure_facts):
            between = "a curve between readings"
        level = f"through pneumatics '{choice.pneumatics}'" if choice.sort == "commanded" else "acting as they are"
        lines = [
            f"{self.name} of {self.arm.name}: {len(self)} rows, {self.clock.duration:g} s, {_rate(self.clock)}",
            f"pressures: {choice.sort} ({choice.chosen}), {between}, {level}, ambient {choice.ambient_pressure:g} Pa",
            *(_line(fact) for fact in (*self.pressure_facts, *self.facts)),
            *self.notes,
            *(f"warning: {text}" for text in self.findings),
        ]
        return "\n".join(lines)


def recordings(
    arm: Arm,
    logs: Recording | Log | str | os.PathLike[str] | Sequence[Recording | Log | str | os.PathLike[str]],
    *,
    pressures: PressureSort | None = None,
    missing: bool = False,
    mapping: str | os.PathLike[str] | None = None,
    warn: bool = True,
) -> list[Recording]:
    """Recordings of a log or several by one arm, all with the same sort of pressures: of the first, if not asked for.

    ``warn`` says whether to warn of what each finds.

    Raises:
        InputError: there is no log, or a recording is of another arm.
        LogError: as :class:`Recording`.
    """
    if isinstance(logs, Log | Recording | str | os.PathLike):
        logs = [logs]
    made: list[Recording] = []
    for item in logs:
        if isinstance(item, Recording):
            if item.arm != arm:
                raise InputError(f"{item.name}: a recording of {item.arm.name}, not of {arm.name}")
            made.append(item)
        else:
            made.append(Recording(arm, item, pressures=pressures, missing=missing, mapping=mapping, warn=warn))
        pressures = pressures or made[0].pressures.sort
    return made


def _rate(found: clock.ClockFacts) -> str:
    rate = f"{1.0 / found.interval:.4g} rows a second" if found.interval > 0.0 else "all at one time"
    return rate + (f", stamped by a timer of {1e3 * found.tick:.3g} ms" if found.tick > 0.0 else "")


def _line(fact: ChannelFacts) -> str:
    parts = [f"noise {fact.noise:.3g} {fact.unit}" if fact.noise > 0.0 else "noise not told"]
    if fact.quantum > 0.0:
        parts.append(f"steps of {fact.quantum:.3g} {fact.unit}")
    return f"{fact.name}: " + ", ".join(parts)
