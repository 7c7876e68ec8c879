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
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError, LogError, LogWarning
from bha.logs import Log
from bha.recordings import aligned, clock, compare, frozen, pressures, ranges, samples, stairs, unused
from bha.recordings.outputs import Output, observe
from bha.recordings.pressures import PressureChoice, PressureSort
from bha.recordings.samples import ChannelFacts
from bha.runs.input import Input

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: How long an arm takes to forget what a frozen pressure did to it, s.
RECOVERY = 1.0


class Recording:
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
            name: what to call it; the file's name if None.
            warn: whether to warn of the findings.

        Raises:
            LogError: the log cannot be read, lacks a pressure of the arm, or has a name that the arm's layout
                contradicts.
            InputError: an argument that is not allowed.

        Warns:
            LogWarning: each of the findings.
        """
        if not isinstance(log, Log):
            ambient = arm.parameters.ambient_pressure
            log = Log.read(log, ambient_pressure=ambient, missing=missing)
        self.arm = arm
        self.log = log.with_ambient_pressure(arm.parameters.ambient_pressure)
        self.name = name or (log.path.name if log.path is not None else "<arrays>")
        self.time, self.clock = clock.mended(self.log.time)
        self._read_outputs()
        self._read_pressures(pressures)
        self._judge_together()
        self.findings = tuple(self._found())
        if warn:
            for text in self.findings:
                warnings.warn(f"{self.name}: {text}", LogWarning, stacklevel=2)

    def _read_outputs(self) -> None:
        self.observation, self.measured, self._said = observe(self.arm, self.log, self.name)
        judged = [samples.judge(self.time, o.name, o.unit, self.measured[:, k]) for k, o in enumerate(self.outputs)]
        self.facts: tuple[ChannelFacts, ...] = tuple(fact for fact, _ in judged)
        self.usable: Mask = np.column_stack([m for _, m in judged]) if judged else np.empty(self.measured.shape, bool)
        for array in (self.time, self.measured):
            array.flags.writeable = False

    def _read_pressures(self, asked: PressureSort | None) -> None:
        sort, chosen = pressures.choose_sort(self.arm, self.log, asked, self.name)
        if foreign := pressures.names_no_input(self.arm, self.log):
            raise LogError(
                f"{self.name}: there is a column '{foreign[0]}', but {self.arm.name} has no such input; allowed: "
                f"{', '.join(self.arm.inputs)} and {pressures.commanded_name(self.arm.inputs[0])} ... Add the bellows "
                "it feeds to the arm's file, or rename or remove the column"
            )
        commanded = sort == "commanded"
        columns = tuple(pressures.commanded_name(n) if commanded else n for n in self.arm.inputs)
        self._raw = self.log.pressures(self.arm.inputs, commanded=commanded)
        judged = [
            samples.judge(self.time, n, "Pa", self._raw[:, k], measured=not commanded) for k, n in enumerate(columns)
        ]
        self.pressure_facts: tuple[ChannelFacts, ...] = tuple(fact for fact, _ in judged)
        self._pressure_usable = np.column_stack([m for _, m in judged])
        held = pressures.is_held_between(self.time, self._raw, sort)
        self.pressures = PressureChoice(
            sort=sort,
            chosen=chosen,
            columns=columns,
            between_samples="hold" if held else "linear",
            pneumatics=self.arm.pneumatics_level if commanded else "ideal",
            ambient_pressure=self.arm.parameters.ambient_pressure,
            gauge=tuple(n for n in self.log.gauge_columns if n in columns),
        )
        acts = commanded or self.arm.pneumatics_level == "ideal"
        self.acting = self.arm if acts else self.arm.with_changes(pneumatics="ideal")

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

    def _leave_out_unknown(self) -> None:
        """What the arm does while it is not known what drives it does not count."""
        noise = np.array([fact.noise for fact in self.facts])
        shown = np.where(self.usable, self.measured, np.nan)
        spans = frozen.frozen_spans(self.time, self._raw, self.time, shown, noise)
        if spans:
            self.pressure_facts = tuple(samples.with_frozen(fact, spans) for fact in self.pressure_facts)
        missed = pressures.missed_spans(self.time, self._raw, self.pressure_facts)
        for start, end in (*spans, *missed):
            # What drove the arm meanwhile is not known, and it takes a while to forget it.
            self.usable[(self.time > start) & (self.time <= end + RECOVERY)] = False

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
    def outputs(self) -> tuple[Output, ...]:
        """The measured channels: lengths, then head positions, then orientations."""
        return self.observation.outputs

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.observation.names

    @property
    def noise(self) -> Array:
        """Standard deviation of each output's noise, in its unit, shape (C,); 0 where the channel does not tell."""
        return np.array([fact.noise for fact in self.facts])

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done about samples that are no readings, a text each."""
        said = []
        if self.clock.tick > 0.0:
            tick = f"{1e3 * self.clock.tick:.3g} ms"
            said.append(f"rows were stamped by a timer of {tick}; they are taken as even, {_rate(self.clock)}")
        if self._stairs is not None and self._stairs.act:
            said.append(self._stairs.in_words())
        curve = "the curve between its readings drives"
        if self._stairs is not None and not self._stairs.told:
            curve += " (or steps might: the outputs do not tell them apart)"
        for fact, verb in (
            *((f, curve) for f in self.pressure_facts),
            *((f, "its repeats do not count") for f in self.facts),
        ):
            if fact.held > 0.0:
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
        """``"from 3.1 s to 3.7 s, from 5 s to 6 s and 2 more"``."""
        first = float(self.time[0])
        shown = ", ".join(f"from {ranges.moment(a, first)} to {ranges.moment(b, first)}" for a, b in spans[:3])
        return shown + (f" and {len(spans) - 3} more" if len(spans) > 3 else "")

    @property
    def pressure_noise(self) -> Array:
        """White noise of the samples of ``drive``, Pa, shape (inputs,), that acts on the arm as that of readings does.

        A reading of a sensor that holds stands for several samples: their errors are one, and weigh more.
        """
        return np.array([fact.noise / np.sqrt(1.0 - fact.held) for fact in self.pressure_facts])

    @cached_property
    def _drive(self) -> tuple[Input, NDArray[np.intp]]:
        return self.drive_by(self.pressures.between_readings, self.pressures.between_samples)

    def drive_by(
        self, readings: Literal["curve", "steps"], between: Literal["linear", "hold"]
    ) -> tuple[Input, NDArray[np.intp]]:
        """:attr:`drive` and :attr:`drive_rows` by some reading of pressures that are held, see `PressureChoice`."""
        forces = self.log.forces_on(self.arm.section_count)
        commanded = self.pressures.sort == "commanded"
        facts, usable = self.pressure_facts, self._pressure_usable
        curve = readings == "curve"
        values = pressures.between_fresh(self.time, self._raw, facts, usable) if curve else self._raw
        if between == "hold":
            time, values, forces, rows = pressures.with_jumps(self.time, values, forces)
        else:
            time, rows = self.time, np.arange(len(self.time))
        return Input(time, values, forces, commanded), rows

    @property
    def drive(self) -> Input:
        """Pressures and external forces as the model takes them: linear between samples, jumps of held commands."""
        return self._drive[0]

    @property
    def drive_rows(self) -> NDArray[np.intp]:
        """For each row of the log its sample of :attr:`drive`, shape (m,)."""
        return self._drive[1]

    @cached_property
    def aligned(self) -> tuple[NDArray[np.intp], Array, Mask]:
        """Rows (k,) in which all outputs are known together, their values (k, C) there, and which of these count."""
        return aligned.aligned(self.time, self.measured, self.usable, self.facts)

    def errors(self, trajectory: Trajectory) -> Array:
        """Simulated minus measured outputs at the rows of a trajectory of this drive, shape (rows, C).

        NaN where nothing was measured: outside of the log, in dropouts, where a reading does not count.
        """
        return compare.errors(self, trajectory)

    def as_trajectory(self) -> Trajectory:
        """What was measured as a trajectory, NaN where it was not: to be drawn beside a simulated one."""
        return compare.as_trajectory(self)

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)

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

    def __str__(self) -> str:
        """What was decided and found, in a few lines."""
        choice = self.pressures
        between = "held between changes" if choice.between_samples == "hold" else "linear between samples"
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
            made.append(Recording(arm, item, pressures=pressures, missing=missing, warn=warn))
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
