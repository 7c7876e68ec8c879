"""One log as one arm reads it, channel by channel, before the arm is asked what only it can tell."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import LogError
from bha.logs import Log
from bha.recordings import aligned, clock, frozen, hung, pressures, samples, together
from bha.recordings.doubt import Doubt
from bha.recordings.outputs import Output, observe
from bha.recordings.pressures import PressureChoice, PressureSort
from bha.recordings.samples import ChannelFacts
from bha.runs.input import Input

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: How long an arm takes to forget what a frozen pressure did to it, s.
RECOVERY = 1.0
#: A measured pressure has changed from so many noises, or steps of its grid; a commanded one whenever it does.
_CHANGE = 4.0


class Readings:
    """What a log says of an arm, and what each sample is worth by itself; see :class:`bha.Recording`."""

    def __init__(
        self,
        arm: Arm,
        log: Log | str | os.PathLike[str],
        *,
        pressures: PressureSort | None = None,
        missing: bool = False,
        mapping: str | os.PathLike[str] | None = None,
        name: str | None = None,
    ) -> None:
        """Read a log, or the path of one, as :class:`bha.Recording` does."""
        if not isinstance(log, Log):
            ambient = arm.parameters.ambient_pressure
            log = Log.read(log, ambient_pressure=ambient, missing=missing, mapping=mapping)
        self.arm = arm
        self.log = log.with_ambient_pressure(arm.parameters.ambient_pressure)
        self.name = name or (log.path.name if log.path is not None else "<arrays>")
        self._read_outputs()
        self._read_pressures(pressures)
        self._leave_out_hung()

    def _read_outputs(self) -> None:
        self.observation, self.measured, self._said = observe(self.arm, self.log, self.name)
        self.time, self.clock = clock.mended(self.log.time, self.measured)
        judged = [samples.judge(self.time, o.name, o.unit, self.measured[:, k]) for k, o in enumerate(self.outputs)]
        judged = together.on_one_clock(self.time, self.measured, judged)
        judged = together.stopped_together(self.time, self.measured, judged)
        judged = together.held_together(self.time, self.measured, judged)
        self.facts: tuple[ChannelFacts, ...] = tuple(fact for fact, _ in judged)
        self.usable: Mask = np.column_stack([m for _, m in judged]) if judged else np.empty(self.measured.shape, bool)
        for array in (self.time, self.measured):
            array.flags.writeable = False

    def _leave_out_hung(self) -> None:
        """What outputs repeat at the end of the log while the pressures go on does not count."""
        if not self.outputs:
            return
        stopped = {span for fact in self.facts for span in fact.dropouts}
        times = 0.0 if self.pressures.sort == "commanded" else _CHANGE
        least = np.array([times * max(fact.noise, fact.quantum) for fact in self.pressure_facts])
        first = hung.hangs_from(self.time, self.measured, self._raw, least, stopped)
        if first is None:
            return
        for k, fact in enumerate(self.facts):
            judged = together.stopped_between((fact, self.usable[:, k]), self.time, first, len(self.time))
            self.facts = (*self.facts[:k], judged[0], *self.facts[k + 1 :])
            self.usable[:, k] = judged[1]

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
        self._pressure_usable = np.column_stack([m for _, m in judged])
        facts = [fact for fact, _ in judged]
        if not commanded:
            facts = [
                pressures.with_curve(
                    pressures.with_quiet_noise(fact, self._raw[good, k]), self.time, self._raw[:, k], good
                )
                for k, (fact, good) in enumerate(zip(facts, self._pressure_usable.T, strict=True))
            ]
        self.pressure_facts: tuple[ChannelFacts, ...] = tuple(facts)
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
    def pressure_noise(self) -> Array:
        """White noise of the samples of ``drive``, Pa, shape (inputs,), that acts on the arm as that of readings does.

        A reading of a sensor that holds stands for several samples: their errors are one, and weigh more.
        """
        return self.acting_noise(np.array([fact.noise for fact in self.pressure_facts]))

    def acting_noise(self, noise: Array) -> Array:
        """The same for readings with some ``noise``, Pa, shape (inputs,)."""
        samples_a_row = len(pressures.samples_of(self.time, self.pressure_facts)[0]) / len(self.time)
        shares = np.array([1.0 - fact.held for fact in self.pressure_facts]) / samples_a_row
        return np.asarray(noise / np.sqrt(shares))

    def left_open(self, noise: Array) -> tuple[Doubt, ...]:
        """What readings leave open of each pressure of ``drive`` between them; nothing where they act as steps.

        Args:
            noise: of the readings, Pa, shape (inputs,).
        """
        if self.pressures.sort == "commanded" or self.pressures.between_readings == "steps":
            return ()
        return pressures.left_open(self.time, self._raw, self.pressure_facts, self._pressure_usable, noise)

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
        time, values, rows = self.time, self._raw, np.arange(len(self.time))
        if curve:
            time, values, rows = pressures.between_fresh(time, values, facts, usable)
        if between == "hold":
            time, values, forces, rows = pressures.with_jumps(time, values, forces)
        elif forces is not None and len(time) > len(self.time):
            flat = forces.reshape(len(forces), -1)
            forces = np.column_stack([np.interp(time, self.time, c) for c in flat.T]).reshape(-1, *forces.shape[1:])
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

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)
