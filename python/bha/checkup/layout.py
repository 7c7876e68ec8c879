"""Which way each pressure pushes each section, from the geometry of the parameter file alone.

What: for section i and input j the bending that a pressure drives, a complex number ``bending[i, j]``, m^3, and the
lengthening that it drives, ``axial[i, j]``, m^2: sums over the bellows of the section that the input feeds of
``- area * radius * exp(i angle)`` and of ``area``.
Frame: that of the section; real part along x, imaginary part along y. The head of a section moves away from a bellows
under pressure, hence the sign.
Source: docs/explanation/model.md: q_k = l - r (u cos a_k + v sin a_k), the bending being w = u + i v.
Validity: directions and the ratio of areas. How far the arm moves depends on stiffness, which is known badly, and is
left to the logs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.errors import BhaError
from bha.recordings.ranges import input_ranges

if TYPE_CHECKING:
    from bha.arm import Arm

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Arms of more sections are checked for all but what motions tell: the ways to exchange tubes are too many.
MOST_SECTIONS = 12


@dataclass(frozen=True)
class Layout:
    """Geometry of the n sections and J inputs of an arm.

    Attributes:
        inputs: names of the inputs.
        bending: drive of the bending, shape (n, J), complex.
        axial: drive of the mean length, shape (n, J).
        angles: angle of each bellows of each section, rad.
        radii: distance of each bellows from the centre line, m.
        fed_by: index of the input that feeds each bellows of each section.
        coordinate_radius: radius of the three coordinates of each section, m, shape (n,).
        base_rotation: axes of the base in the world as columns, shape (3, 3).
        base_offset: rigid piece before the bending part of each section, m, shape (n,).
        head_offset: rigid piece after it, m, shape (n,).
        length_range: shortest and longest permitted length, m, shape (n, 2).
        bending_gain: how far the file's model bends each section for its drive, rad / (m^3 Pa), shape (n,); NaN where
            it holds no pose. Of the right order at best.
        pressure_range: least and greatest permitted pressure of each input, Pa, shape (J, 2): what all sections that it
            feeds permit.
    """

    inputs: tuple[str, ...]
    bending: Complex
    axial: Array
    angles: tuple[Array, ...]
    radii: tuple[Array, ...]
    fed_by: tuple[NDArray[np.intp], ...]
    coordinate_radius: Array
    base_rotation: Array
    base_offset: Array
    head_offset: Array
    length_range: Array
    pressure_range: Array
    bending_gain: Array

    @property
    def section_count(self) -> int:
        """Number of sections, n."""
        return len(self.angles)

    def inputs_of(self, section: int) -> list[int]:
        """Indices of the inputs that feed a section (index from 0), in the order of its bellows."""
        return list(dict.fromkeys(self.fed_by[section].tolist()))

    def sections_of(self, j: int) -> list[int]:
        """Indices of the sections that an input feeds."""
        return [i for i in range(self.section_count) if j in self.fed_by[i]]

    def equal_bellows(self, section: int) -> bool:
        """Whether the bellows of a section are evenly spread, one an input, with equal drive."""
        own = self.inputs_of(section)
        drive = self.bending[section, own]
        if len(own) != len(self.fed_by[section]) or len(own) < 3:
            return False
        turned = np.sort(np.mod(np.angle(drive), 2 * np.pi))
        even = np.allclose(np.diff(turned), 2 * np.pi / len(own), atol=0.02)
        return bool(even and np.allclose(np.abs(drive), np.abs(drive[0]), rtol=0.02))


def layout_of(arm: Arm) -> Layout:
    """The layout of an arm."""
    parameters = arm.parameters
    n, names = arm.section_count, arm.inputs
    bending = np.zeros((n, len(names)), dtype=np.complex128)
    axial = np.zeros((n, len(names)))
    permitted = input_ranges(arm)
    angles, radii, fed_by = [], [], []
    for i, section in enumerate(parameters.sections):
        bellows = section.resolved_bellows(i + 1)
        feeds = np.array([names.index(b.input) for b in bellows], dtype=np.intp)
        for b, j in zip(bellows, feeds, strict=True):
            bending[i, j] -= b.terminal_area * b.radius * np.exp(1j * b.angle)
            axial[i, j] += b.terminal_area
        angles.append(np.array([b.angle for b in bellows]))
        radii.append(np.array([b.radius for b in bellows]))
        fed_by.append(feeds)
    sections = parameters.sections
    return Layout(
        inputs=tuple(names),
        bending=bending,
        axial=axial,
        angles=tuple(angles),
        radii=tuple(radii),
        fed_by=tuple(fed_by),
        coordinate_radius=np.array([s.bellows_radius for s in sections]),
        base_rotation=parameters.base_pose.rotation_matrix,
        base_offset=np.array([s.base_offset for s in sections]),
        head_offset=np.array([s.head_offset for s in sections]),
        length_range=np.array([s.length_range for s in sections]),
        pressure_range=permitted,
        bending_gain=_bending_gain(arm, bending, permitted),
    )


def _bending_gain(arm: Arm, bending: Complex, permitted: Array) -> Array:
    """Bending of each section by its drive, from the poses that the model holds around the middle of its pressures."""
    gains = np.full(arm.section_count, np.nan)
    if arm.section_count > MOST_SECTIONS:
        return gains
    middle = np.minimum(permitted.mean(axis=1), permitted[:, 0] + arm.parameters.ambient_pressure)
    for i, section in enumerate(arm.parameters.sections):
        j = int(np.argmax(np.abs(bending[i])))
        step = np.zeros(len(middle))
        step[j] = 0.05 * (permitted[j, 1] - permitted[j, 0])
        if not np.any(bending[i]):
            continue
        try:
            more, less = (arm.static_lengths(middle + sign * step)[3 * i : 3 * i + 3] for sign in (1.0, -1.0))
        except BhaError:
            continue  # what holds no pose says nothing of sizes; directions are enough
        w = np.sum((more - less) * np.exp(2j * np.pi / 3 * np.arange(3))) * (2.0 / 3.0) / section.bellows_radius
        gains[i] = float(np.abs(w) / (np.abs(bending[i, j]) * 2.0 * step[j]))
    return gains
