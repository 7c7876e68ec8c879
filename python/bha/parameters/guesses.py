"""What no tape measure tells of an arm, guessed from what it tells: area, stiffness, bending, damping, ranges.

The rules, for a section with n bellows of diameter d at radius r, with the weight W of its own and all outer masses:

===================  ==================================  =================================================
area A               0.9 π d² / 4                        a bellows pushes with its mean diameter, (d + root) / 2; roots
                                                         at 0.9 d
stiffness k          A p_max / (longest - length)        both lengths bear the same weight, which falls out
rest length          length ∓ W / (n k)                  - hanging, + upright: the length without the weight
bending stiffness    n k d_m² / 8, d_m = 0.95 d          a bellows is a spring of rate k spread over the circle of its
                                                         mean diameter
damping              2 ζ sqrt(n k M) / n, ζ = 0.3        M: its own and all outer masses, on all its springs
===================  ==================================  =================================================

Small angles and straight arms throughout: they are starts for an identification, right to a factor, not results.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.errors import ParameterError
from bha.parameters.tape_measure import STANDARD_GRAVITY, MeasuredArm, MeasuredSection

#: Area over that of the outer diameter's circle, and mean over outer diameter.
AREA_RATIO, MEAN_DIAMETER_RATIO = 0.9, 0.95
DAMPING_RATIO = 0.3
#: Shortest over length at ambient pressure: how far bellows are usually compressed.
USUAL_COMPRESSION = 0.7


@dataclass(frozen=True)
class GuessedSection:
    """What a section's file needs beside its measures; SI units, names of the parameter file."""

    terminal_area: float
    stiffness: float
    rest_length: float
    bending_stiffness: float
    damping: float
    length_range: tuple[float, float]

    def bending_rate(self, section: MeasuredSection) -> float:
        """Bending moment over bending angle in the plane that resists least, by springs and bending stiffness, N m."""
        share = 0.5 * section.bellows if section.bellows > 2 else 0.0
        return share * self.stiffness * section.radius**2 + self.bending_stiffness


def guesses(arm: MeasuredArm) -> tuple[GuessedSection, ...]:
    """The guesses of each section, for measures that :func:`bha.parameters.tape_measure.check` has passed.

    Raises:
        ParameterError: the weight alone would stretch the bellows of a section by all their length.
    """
    outer = np.cumsum([section.mass for section in reversed(arm.sections)])[::-1]
    bare = [_of_section(arm, section, float(mass)) for section, mass in zip(arm.sections, outer, strict=True)]
    for number, (section, guess) in enumerate(zip(arm.sections, bare, strict=True), start=1):
        if guess.rest_length <= 0.0:
            stretch = 1e3 * (section.length - guess.rest_length)
            raise ParameterError(
                f"{arm.name}: section {number}: {outer[number - 1]:.4g} kg hang on bellows that {arm.pressure_max:.4g} "
                f"Pa lengthen by {1e3 * (section.resolved_longest - section.length):.4g} mm; they would be stretched "
                f"by {stretch:.4g} mm, more than their length of {1e3 * section.length:.4g} mm. Check masses, "
                "diameter, pressure_max and longest"
            )
    return tuple(_with_range(arm, i, bare) for i in range(len(bare)))


def _of_section(arm: MeasuredArm, section: MeasuredSection, mass: float) -> GuessedSection:
    """``mass`` is the section's own and that of all outer ones, kg."""
    n = section.bellows
    area = AREA_RATIO * math.pi / 4.0 * section.diameter**2 if section.area is None else section.area
    stiffness = area * arm.pressure_max / (section.resolved_longest - section.length)
    along = arm.gravity[2]
    return GuessedSection(
        terminal_area=area,
        stiffness=stiffness,
        rest_length=section.length - mass * along / (n * stiffness),
        bending_stiffness=n * stiffness * (MEAN_DIAMETER_RATIO * section.diameter) ** 2 / 8.0,
        damping=2.0 * DAMPING_RATIO * math.sqrt(n * stiffness * mass) / n,
        length_range=(section.length, section.resolved_longest),
    )


def _with_range(arm: MeasuredArm, i: int, bare: list[GuessedSection]) -> GuessedSection:
    """With the range of lengths that pressures and, where the arm lies, its weight bring about."""
    section, guess = arm.sections[i], bare[i]
    travel = section.resolved_longest - section.length
    bent = section.radius * min(sag_angles(arm, bare)[i], 1.5)
    low = section.length + guess.terminal_area * arm.pressure_min / guess.stiffness
    low = max(min(USUAL_COMPRESSION * section.length, low - 0.1 * travel) - bent, 0.05 * section.length)
    high = section.resolved_longest + 0.1 * travel + bent
    return GuessedSection(**{**vars(guess), "length_range": (low, high)})


def doubts(arm: MeasuredArm, guessed: tuple[GuessedSection, ...]) -> list[str]:
    """What is odd about an arm with these guesses, a text each: too heavy for its bellows, too soft, too far bent."""
    return [*_section_doubts(arm, guessed), *_buckling(arm, guessed)]


def _section_doubts(arm: MeasuredArm, guessed: tuple[GuessedSection, ...]) -> Iterator[str]:
    sag = sag_angles(arm, guessed)
    for number, (section, guess) in enumerate(zip(arm.sections, guessed, strict=True), start=1):
        stretch = abs(guess.rest_length - section.length) / section.length
        if stretch > 0.5:
            moved = f"{100.0 * stretch:.0f} % of their length; check masses, diameter, pressure_max and longest"
            yield f"section {number}: its weight and that of the outer sections moves its bellows by {moved}"
        if sag[number - 1] > 1.0:
            yield f"section {number}: the weight bends it by {math.degrees(sag[number - 1]):.0f} degrees as it lies"
        alone = guess.terminal_area * arm.pressure_max * section.radius
        if section.bellows > 2 and (angle := alone / guess.bending_rate(section)) > math.pi:
            yield (
                f"section {number}: one bellows alone would bend it by {math.degrees(angle):.0f} degrees; check "
                "radius, length and longest"
            )


def _buckling(arm: MeasuredArm, guessed: tuple[GuessedSection, ...]) -> Iterator[str]:
    if arm.mounting != "upright":
        return
    rates = np.diag([guess.bending_rate(section) for section, guess in zip(arm.sections, guessed, strict=True)])
    least = float(np.linalg.eigvalsh(rates - toppling(arm)).min())
    if least <= 0.0:
        yield (
            "mounting: upright the arm would bend aside under its own weight without pressure; check masses, "
            "diameter, pressure_max and longest, or name the mounting"
        )


def sag_angles(arm: MeasuredArm, guessed: tuple[GuessedSection, ...] | list[GuessedSection]) -> NDArray[np.float64]:
    """Bending angle of each section of an arm that lies, by its weight, to first order, rad; 0 where it does not."""
    angles = np.zeros(len(arm.sections))
    if arm.mounting != "lying":
        return angles
    for i, (section, guess) in enumerate(zip(arm.sections, guessed, strict=True)):
        # A head is half of the arc's length aside for each radian of bending, what is beyond it by its whole distance.
        distance, moment = 0.5 * section.length + section.head_offset, 0.0
        for j in range(i, len(arm.sections)):
            if j > i:
                distance += arm.sections[j].base_offset + arm.sections[j].length + arm.sections[j].head_offset
            moment += STANDARD_GRAVITY * arm.sections[j].mass * distance
        angles[i] = moment / max(guess.bending_rate(section), math.ulp(0.0))
    return angles


def toppling(arm: MeasuredArm) -> NDArray[np.float64]:
    """Moment by which the weight of an upright arm bends its sections, over their bending angles in one plane, N m.

    Second derivatives of the heights of all heads: a piece of length L whose direction turns from angle φ by ψ is
    lower by L (φ² + φ ψ + ψ²/3) / 2. An upright arm is stable where what resists is greater.
    """
    count = len(arm.sections)
    lowered = np.zeros((count, count))  # second derivatives of what the head reached so far is lower by
    total = np.zeros((count, count))
    before = np.zeros(count)  # the direction where a section begins is the sum of the bending angles before it
    for i, section in enumerate(arm.sections):
        own = np.eye(count)[i]
        cross = np.outer(before, own)
        lowered = lowered + section.base_offset * np.outer(before, before)
        lowered = lowered + section.length * (
            np.outer(before, before) + 0.5 * (cross + cross.T) + np.outer(own, own) / 3.0
        )
        before = before + own
        lowered = lowered + section.head_offset * np.outer(before, before)
        total += STANDARD_GRAVITY * section.mass * lowered
    return total
