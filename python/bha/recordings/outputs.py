"""What a log measures of an arm, and how it follows from the arm's coordinates and heads.

Lengths of bellows and wires are linear in the coordinates (``bha.arm.geometry``). Positions and orientations of
heads are seen in the camera's frame, which the arm's file may shift and turn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from bha import _core, names
from bha.arm import geometry
from bha.errors import LogError
from bha.logs.units import UnitError, factor_to_si
from bha.support.shown import short_repr

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.logs import Log
    from bha.parameters import ArmParameters

Array = NDArray[np.float64]
Kind = Literal["length", "position", "orientation"]


@dataclass(frozen=True)
class Output:
    """One measured channel.

    Attributes:
        name: of the log's column: ``q11``, ``wire1l``, ``x2``, ``ow1``.
        kind: ``"length"``, ``"position"`` or ``"orientation"``.
        unit: ``"m"``, or empty for a component of a quaternion.
        section: number of the section whose head it belongs to, or at whose head a length ends, from 1.
        number: of the bellows or coordinate; of the axis, from 1 for x; of the quaternion's component, from 1 for w; 0
            for a wire.
        source: what a length is of: ``"bellows"``, ``"coordinate"`` or ``"wire"``; empty for heads.
        place: where it is measured, for people: ``"bellows 2 at 120 deg, radius 0.1 m"``.
    """

    name: str
    kind: Kind
    unit: str
    section: int
    number: int
    source: str = ""
    place: str = ""


@short_repr
@dataclass(frozen=True)
class Observation:
    """The outputs as a function of coordinates and heads.

    Attributes:
        outputs: the channels, lengths first, then positions, then orientations.
        rows: of the lengths over the coordinates, shape (lengths, 3n); ``offsets`` are added, m, shape (lengths,).
        offsets: see ``rows``.
        camera: the frame in which heads are measured.
        gains: of the length sensors by the arm's effects, shape (lengths,): they show gain times length plus shift.
        shifts: see ``gains``, m.
        core_gains: the same as the core applies them to the coordinates, shape (3n,).
        core_shifts: see ``core_gains``, m.
    """

    outputs: tuple[Output, ...]
    rows: Array
    offsets: Array
    camera: geometry.CameraFrame
    gains: Array
    shifts: Array
    core_gains: Array
    core_shifts: Array

    @classmethod
    def of(cls, parameters: ArmParameters, outputs: Sequence[Output]) -> Observation:
        """The outputs as an arm of these parameters shows them."""
        rows, offsets = [], []
        count = len(parameters.sections)
        wires = {sensor.name: sensor for sensor in parameters.length_sensors}
        for output in outputs:
            if output.source == "wire":
                rows.append(geometry.wire_row(parameters, wires[output.name]))
                offsets.append(wires[output.name].offset)
            elif output.source:
                place = output.section - 1
                if output.source == "bellows":
                    table = geometry.bellows_length_rows(parameters.sections[place], place, count)
                else:
                    table = np.eye(3 * count)[3 * place : 3 * place + 3]
                rows.append(table[output.number - 1])
                offsets.append(0.0)
        lengths = [(o.section, o.number if o.source != "wire" else None) for o in outputs if o.source]
        coordinates = [(i, k) for i in range(1, count + 1) for k in (1, 2, 3)]
        gains, shifts = _sensor_errors(parameters, lengths)
        core_gains, core_shifts = _sensor_errors(parameters, coordinates)
        return cls(
            outputs=tuple(outputs),
            rows=np.array(rows) if rows else np.empty((0, 3 * count)),
            offsets=np.array(offsets),
            camera=geometry.camera_frame(parameters.sensors),
            gains=gains,
            shifts=shifts,
            core_gains=core_gains,
            core_shifts=core_shifts,
        )

    @cached_property
    def is_length(self) -> NDArray[np.bool_]:
        """Which channels are lengths, shape (C,)."""
        return np.array([output.kind == "length" for output in self.outputs], dtype=np.bool_)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(output.name for output in self.outputs)

    @cached_property
    def needs_positions(self) -> bool:
        """Whether some channel is a position."""
        return any(output.kind == "position" for output in self.outputs)

    @cached_property
    def needs_orientations(self) -> bool:
        """Whether some channel is of an orientation."""
        return any(output.kind == "orientation" for output in self.outputs)

    @cached_property
    def _length_columns(self) -> NDArray[np.intp] | None:
        """The coordinates as the core measures them, where every length is one: nothing is to be computed then."""
        unit = (np.sum(self.rows != 0.0, axis=1) == 1) & np.any(self.rows == 1.0, axis=1) & (self.offsets == 0.0)
        return np.argmax(self.rows, axis=1) if np.all(unit) else None

    def _places(self, kind: Kind) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Section and component, from 0, of the channels of one kind."""
        own = [o for o in self.outputs if o.kind == kind]
        return np.array([o.section - 1 for o in own], dtype=np.intp), np.array(
            [o.number - 1 for o in own], dtype=np.intp
        )

    def _seen(self, kind: Kind, heads: Array, by: Callable[[Array], Array]) -> Array:
        """The channels of one kind, shape (..., C), out of all heads (..., n, k), of which the measured are turned."""
        section, component = self._places(kind)
        own, place = np.unique(section, return_inverse=True)
        return np.asarray(by(heads[..., own, :])[..., place, component])

    def predicted(self, lengths: Array, positions: Array | None = None, orientations: Array | None = None) -> Array:
        """The channels, shape (..., C), out of what the core measures: coordinates and heads in the world.

        The core has taken the delays of sensors into account, and has applied gains and offsets of length sensors to
        the coordinates; where sensors sit elsewhere these are taken back and applied to the lengths there.

        Args:
            lengths: coordinates, m, shape (..., 3n).
            positions: of the heads, m, shape (..., n, 3); needed where a channel is a position.
            orientations: of the heads, quaternions, shape (..., n, 4); needed where a channel is of an orientation.
        """
        columns = self._length_columns
        if columns is None:
            true = (lengths - self.core_shifts) / self.core_gains
            parts = [(true @ self.rows.T + self.offsets) * self.gains + self.shifts]
        else:
            parts = [lengths[..., columns]]
        if self.needs_positions:
            assert positions is not None
            parts.append(self._seen("position", positions, self.camera.positions))
        if self.needs_orientations:
            assert orientations is not None
            parts.append(self._seen("orientation", orientations, self.camera.orientations))
        return np.concatenate(parts, axis=-1) if len(parts) > 1 else np.asarray(parts[0])

    def at(self, arm: _core.Arm, q: Array) -> tuple[Array, Array]:
        """Lengths and positions at true coordinates ``q`` (3n,), and their derivatives by these, (C,) and (C, 3n).

        Orientations are left out: what follows them are the last columns, zero here.
        """
        positions, _ = arm.forward_kinematics(q)
        values = np.zeros(len(self.outputs))
        slopes = np.zeros((len(self.outputs), len(q)))
        count = len(self.rows)
        values[:count] = (self.rows @ q + self.offsets) * self.gains + self.shifts
        slopes[:count] = self.rows * self.gains[:, None]
        if self.needs_positions:
            section, axis = self._places("position")
            last = count + len(section)
            turned = self.camera.matrix.T
            seen = np.stack([turned @ arm.jacobian(q, i)[:3] for i in range(1, len(q) // 3 + 1)])
            values[count:last] = self.camera.positions(positions)[section, axis]
            slopes[count:last] = seen[section, axis]
        return values, slopes


def coordinate_outputs(arm: Arm) -> list[Output]:
    """All coordinates of an arm, measured where they are defined."""
    sections = enumerate(arm.parameters.sections, start=1)
    return [
        _coordinate(names.coordinate_name(i, k), i, k, section.bellows_radius)
        for i, section in sections
        for k in (1, 2, 3)
    ]


def longest_sensor_delay(parameters: ArmParameters) -> float:
    """The longest delay of any sensor, s: what is measured at a time was so much earlier."""
    delays = (e for e in parameters.effects if e.kind == "delay" and e.place.sort not in ("all", "input"))
    # Places may overlap: their delays add up.
    return sum(float(effect.parameters.get("time", 0.0)) for effect in delays)


def _sensor_errors(parameters: ArmParameters, sensors: Sequence[tuple[int, int | None]]) -> tuple[Array, Array]:
    """Gain and shift, m, of length sensors by the arm's effects; each by its section and number, None for a wire."""
    gains, shifts = np.ones(len(sensors)), np.zeros(len(sensors))
    for effect in parameters.effects:
        if effect.kind not in ("length_gain", "length_offset"):
            continue
        section, number = effect.place.section, effect.place.bellows
        for k, own in enumerate(sensors):
            if own[1] is None or section not in (None, own[0]) or number not in (None, own[1]):
                continue
            if effect.kind == "length_gain":
                factor = 1.0 + effect.parameters["gain"]
                gains[k], shifts[k] = gains[k] * factor, shifts[k] * factor
            else:
                shifts[k] += effect.parameters["offset"]
    return gains, shifts


def observe(arm: Arm, log: Log, origin: str) -> tuple[Observation, Array, list[str]]:
    """What ``log`` measures of ``arm``: the outputs, their values (m, C), and what is to be said.

    Raises:
        LogError: a name that the arm's layout contradicts; the text says the layout.
    """
    said: list[str] = []
    outputs: list[Output] = []
    count = arm.section_count
    _refuse_beyond(log, count, origin)
    for section in range(1, count + 1):
        outputs += _bellows_lengths(arm, log, section, origin, said)
    for sensor in arm.parameters.length_sensors:
        if sensor.name in log:
            where = f"wire at {np.degrees(sensor.angle_rad):g} deg, radius {sensor.radius:g} m"
            outputs.append(Output(sensor.name, "length", "m", max(sensor.sections), 0, "wire", where))
    for section in range(1, count + 1):
        own = names.position_names(section)
        outputs += [Output(name, "position", "m", section, k) for k, name in enumerate(own, start=1) if name in log]
    for section in range(1, count + 1):
        parts = names.orientation_names(section)
        present = [name for name in parts if name in log]
        if present and len(present) < 4:
            absent = ", ".join(name for name in parts if name not in log)
            raise LogError(f"{origin}: of the orientation of head {section} {absent} is missing; all four are needed")
        outputs += [Output(name, "orientation", "", section, k) for k, name in enumerate(present, start=1)]
    observation = Observation.of(arm.parameters, outputs)
    columns = [_in_metres(log, o.name, origin) if o.source == "wire" else log[o.name] for o in outputs]
    table = np.column_stack(columns) if columns else np.empty((len(log), 0))
    first = next((k for k, o in enumerate(outputs) if o.kind == "orientation"), len(outputs))
    if first < len(outputs):
        turned = observation.camera.steady(table[:, first:].reshape(len(table), -1, 4))
        table = np.column_stack([table[:, :first], turned.reshape(len(table), -1)])
    return observation, table, said


def _bellows_lengths(arm: Arm, log: Log, section: int, origin: str, said: list[str]) -> list[Output]:
    """Lengths of a section's bellows, or its coordinates, that the log has."""
    parameters = arm.parameters
    layout = parameters.sections[section - 1].resolved_bellows(section)
    own = [name for k in range(1, 13) if (name := names.length_name(section, k)) in log]
    virtual = [name for k in (1, 2, 3) if (name := names.coordinate_name(section, k)) in log]
    first_three = [names.length_name(section, k) for k in (1, 2, 3)]
    described = ", ".join(f"{np.degrees(b.angle):g}" for b in layout)
    found: list[Output] = []
    as_coordinates = parameters.sensors is not None and parameters.sensors.lengths == "coordinates"
    allowed = 3 if as_coordinates else len(layout)
    if beyond := [name for name in own if _number(name) > allowed]:
        what = "lengths are those at 0, 120, 240 degrees" if as_coordinates else f"bellows at {described} degrees"
        raise LogError(
            f"{origin}: there is a column '{beyond[0]}'; section {section} of {arm.name} has {allowed} lengths "
            f"({what}); allowed: q{section}1 to {names.length_name(section, allowed)}. Rename it, or add the bellows"
        )
    stated = parameters.sensors is not None and "lengths" in parameters.sensors.model_fields_set
    if own and not stated and len(layout) > 3 and all(n in own for n in first_three) and len(own) == 3:
        raise LogError(
            f"{origin}: of section {section} there are {', '.join(own)} only; {arm.name} has {len(layout)} bellows at "
            f'{described} degrees. If these are lengths of the first bellows, write lengths = "bellows" under '
            "[sensors] of the arm's file; if they are the coordinates, lengths at 0, 120 and 240 degrees, "
            f'lengths = "coordinates", or name the columns {names.coordinate_name(section, 1)} ...'
        )
    radius = parameters.sections[section - 1].bellows_radius
    for name in own:
        number = _number(name)
        if as_coordinates:
            found.append(_coordinate(name, section, number, radius))
        else:
            own_place = layout[number - 1]
            where = f"bellows {number} at {np.degrees(own_place.angle):g} deg, radius {own_place.radius:g} m"
            found.append(Output(name, "length", "m", section, number, "bellows", where))
    if own and virtual:
        said.append(f"{', '.join(virtual)}: left aside, for the lengths {', '.join(own)} tell the same")
    elif virtual:
        found += [_coordinate(name, section, _number(name), radius) for name in virtual]
    return found


def _coordinate(name: str, section: int, number: int, radius: float) -> Output:
    where = f"coordinate at {120 * (number - 1)} deg, radius {radius:g} m"
    return Output(name, "length", "m", section, number, "coordinate", where)


def _in_metres(log: Log, name: str, origin: str) -> Array:
    """A wire's column, m; a log keeps columns of names of their own in their own unit."""
    try:
        return np.asarray(log[name] * factor_to_si(log.units[name], "m"))
    except UnitError as error:
        unit = f"unit '{log.units[name]}'" if log.units[name] else "no unit"
        text = f"{origin}: column '{name}', a length sensor of the arm, has {unit}; write it as '{name} [mm]'"
        raise LogError(text) from error


def _number(name: str) -> int:
    quantity = names.quantity(name)
    return 0 if quantity is None else quantity.number


def _refuse_beyond(log: Log, sections: int, origin: str) -> None:
    """An error for lengths, heads and forces of sections that the arm does not have."""
    kinds = ("length", "coordinate", "position", "orientation", "force")
    for name in log.columns:
        quantity = names.quantity(name)
        if quantity is not None and quantity.kind in kinds and quantity.section > sections:
            raise LogError(
                f"{origin}: there is a column '{name}' of section {quantity.section}; the arm has {sections} "
                f"section{'s' if sections != 1 else ''}. Name the arm that was logged, or remove the column"
            )
