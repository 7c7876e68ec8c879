"""Stiffness from steady states, paper section IV-C and D: one linear least-squares fit per section and law.

In a steady state every section is in balance, N(q, 0) = tau(q, p) (62). Along the direction that lengthens all bellows
of a section alike, what pressure and weight do must be done by the springs; along the direction that bends it, by
springs and bending stiffness. The generalized forces of pressure, weight, springs and bending are those of the core
(``actuation_force``, ``bias_force_parts``), so that both force models and arms with several sections are handled
without a formula of their own. Weight is that of the masses the arm already has.

Limits: masses, terminal areas and rest lengths are taken from the arm; poses must be measured completely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.initial import pose
from bha.estimation.records import Record
from bha.estimation.stretches import SteadyState, Stretch, steady_states
from bha.parameters import paths

Array = NDArray[np.float64]

#: A section that bends by less than this is straight, rad.
STRAIGHT = 0.06
#: Bending away from the plane phi = 0 or pi that still counts as in it, rad.
IN_PLANE = 0.2


@dataclass(frozen=True)
class StiffnessFit:
    """A law of one section fitted to steady states; ready to be plotted as Fig. 8 or Fig. 9.

    Attributes:
        section: number of the section, from 1.
        law: ``"longitudinal"`` or ``"bending"``.
        coefficients: of the law, by ascending power: N/m, N/m^2, ... or N m, N m of psi and psi^3.
        standard_errors: of the coefficients.
        abscissa: elongation of the bellows, m, or bending angle with the sign of its side, rad; one a steady state.
        ordinate: spring force of one bellows, N, or bending moment, N m, measured in each.
        residual: ordinate minus the fitted law.
        used: the stretches.
        drift: largest creep of a channel within each, m.
    """

    section: int
    law: str
    coefficients: Array
    standard_errors: Array
    abscissa: Array
    ordinate: Array
    residual: Array
    used: tuple[Stretch, ...]
    drift: Array

    @property
    def paths(self) -> tuple[str, ...]:
        """Where the coefficients stand in a parameter file."""
        key = "stiffness" if self.law == "longitudinal" else "bending_stiffness"
        return tuple(f"section.{self.section}.{key}.{k + 1}" for k in range(len(self.coefficients)))

    def curve(self, abscissa: Array) -> Array:
        """The fitted law at some elongations or angles."""
        return _powers(abscissa, self.law, len(self.coefficients)) @ self.coefficients

    def applied(self, arm: Arm) -> Arm:
        """The arm with these coefficients; terms of the old law beyond them become zero."""
        values = dict(zip(self.paths, map(float, self.coefficients), strict=True))
        section = arm.parameters.sections[self.section - 1]
        stated = section.stiffness if self.law == "longitudinal" else section.bending_stiffness
        key = self.paths[0].rsplit(".", 1)[0]
        values |= {f"{key}.{k}": 0.0 for k in range(len(self.coefficients) + 1, len(stated) + 1)}
        return Arm(paths.with_values(arm.parameters, values))


def longitudinal_stiffness(
    arm: Arm, records: Sequence[Record], section: int, *, order: int = 3, straight: float = STRAIGHT
) -> StiffnessFit:
    """Spring force curve of a section's bellows from its even elongations (Fig. 8).

    Args:
        arm: geometry, masses, areas, rest lengths; its own stiffness does not matter.
        records: logs; their steady states with the section straight are used.
        section: number of the section, from 1.
        order: highest power of (length - rest length), 1 to 8.
        straight: greatest bending angle that counts as straight, rad.

    Raises:
        InputError: too few steady states at different lengths.
    """
    _check_section(arm, section)
    if not 1 <= order <= 8:
        raise InputError(f"order: {order}; 1 to 8 are allowed")
    states = _steady(arm, records)
    # All springs of the section pull alike: the sum over its three coordinates of what they must hold, over their
    # number.
    bare = _bare(arm, section, springs=False, bending=True)
    rows = []
    for rec, state, q in states:
        if _angle(bare, q, section)[0] > straight:
            continue
        unit = _unit_elongation(arm, section)
        needed = _held(bare, rec, state, q) @ unit
        lengths = _bellows_lengths(bare, q, section)
        rows.append((lengths - _rest_lengths(arm, section), needed, state))
    if len({round(float(np.mean(r[0])), 4) for r in rows}) < order + 1:
        raise InputError(
            f"section {section}: {len(rows)} steady states with it straight (below {straight} rad), too few lengths "
            f"for a law of order {order}; inflate all of its bellows evenly, in at least {order + 1} steps, hold each"
        )
    design = np.array([np.sum(_powers(e, "longitudinal", order), axis=0) for e, _, _ in rows])
    needed = np.array([n for _, n, _ in rows])
    coefficients, errors = _least_squares(design, needed)
    count = len(rows[0][0])
    mean = np.array([float(np.mean(e)) for e, _, _ in rows])
    return _fit(
        section, "longitudinal", coefficients, errors, mean, needed / count, design @ coefficients / count, rows
    )


def bending_stiffness(
    arm: Arm,
    records: Sequence[Record],
    section: int,
    *,
    cubic: bool = False,
    straight: float = STRAIGHT,
    in_plane: float = IN_PLANE,
) -> StiffnessFit:
    """Bending moment of a section from poses with phi = 0 or pi (Fig. 9): bellows 2 and 3 evenly against bellows 1.

    Longitudinal springs and weight are taken off with the arm's values: fit :func:`longitudinal_stiffness` first.

    Args:
        arm: geometry, masses, areas, springs.
        records: logs; their steady states with the section bent in its plane are used.
        section: number of the section, from 1.
        cubic: whether to fit k3 too; the paper fits a line.
        straight: bending angles below this are left out, rad.
        in_plane: greatest distance of phi from 0 or pi, rad.

    Raises:
        InputError: too few steady states.
    """
    _check_section(arm, section)
    bare = _bare(arm, section, springs=True, bending=False)
    unit = _unit_bend(arm, section)
    rows = []
    for rec, state, q in _steady(arm, records):
        psi, phi, u = _angle(bare, q, section)
        if psi < straight or abs(np.sin(phi)) > np.sin(in_plane):
            continue
        rows.append((np.array([u]), float(_held(bare, rec, state, q) @ unit), state))
    terms = 2 if cubic else 1
    if len(rows) < terms + 1:
        raise InputError(
            f"section {section}: {len(rows)} steady states with it bent in its plane (phi = 0 or pi within {in_plane} "
            f"rad); at least {terms + 1} are needed: pressurize bellows 2 and 3 evenly against bellows 1, and hold"
        )
    angles = np.array([float(u[0]) for u, _, _ in rows])
    moments = np.array([m for _, m, _ in rows])
    design = _powers(angles, "bending", terms)
    coefficients, errors = _least_squares(design, moments)
    return _fit(section, "bending", coefficients, errors, angles, moments, design @ coefficients, rows)


def _fit(
    section: int,
    law: str,
    coefficients: Array,
    errors: Array,
    abscissa: Array,
    ordinate: Array,
    fitted: Array,
    rows: Sequence[tuple[Array, Array | float, SteadyState]],
) -> StiffnessFit:
    return StiffnessFit(
        section=section,
        law=law,
        coefficients=coefficients,
        standard_errors=errors,
        abscissa=abscissa,
        ordinate=ordinate,
        residual=ordinate - fitted,
        used=tuple(state.stretch for _, _, state in rows),
        drift=np.array([state.drift for _, _, state in rows]),
    )


def _steady(arm: Arm, records: Sequence[Record]) -> list[tuple[Record, SteadyState, Array]]:
    """Steady states with the pose in each, by least squares on the means of what was measured.

    The means matter: a spring force is the difference of large forces, and noise of the pose that is in both what the
    law explains and what it is made of would flatten the law.
    """
    found = []
    for rec in records:
        for state in steady_states(arm, rec):
            deviation = rec.noise / np.sqrt(state.stretch.last - state.stretch.first)
            found.append((rec, state, pose(arm, rec, state.channels, deviation, state.pressures)))
    return found


def _bare(arm: Arm, section: int, *, springs: bool, bending: bool) -> Arm:
    """The arm with the springs or the bending stiffness of one section switched off."""
    values: dict[str, float] = {}
    stated = arm.parameters.sections[section - 1]
    if not bending:
        values |= {f"section.{section}.bending_stiffness.{k + 1}": 0.0 for k in range(len(stated.bending_stiffness))}
    if not springs:
        values |= {f"section.{section}.stiffness.{k + 1}": 0.0 for k in range(len(stated.stiffness))}
        for place, bellows in enumerate(stated.bellows or (), start=1):
            terms = range(len(bellows.stiffness or ()))
            values |= {f"section.{section}.bellows.{place}.stiffness.{k + 1}": 0.0 for k in terms}
    return Arm(paths.with_values(arm.parameters, values))


def _held(bare: Arm, rec: Record, state: SteadyState, q: Array) -> Array:
    """Generalized force on the lengths that the switched-off law must balance, (62), shape (3n,)."""
    forces = None if rec.drive.forces is None else state.forces
    rest = bare.bias_force(q, np.zeros_like(q), forces)
    return np.asarray(bare.actuation_force(q, state.pressures) - rest)


def _unit_elongation(arm: Arm, section: int) -> Array:
    """Change of the lengths when the section's centre line grows by one, shape (3n,)."""
    unit = np.zeros(3 * arm.section_count)
    unit[3 * (section - 1) : 3 * section] = 1.0
    return unit


def _unit_bend(arm: Arm, section: int) -> Array:
    """Change of the lengths per change of u = psi cos(phi): q_k = l - r u cos(a_k), shape (3n,)."""
    unit = np.zeros(3 * arm.section_count)
    radius = arm.parameters.sections[section - 1].bellows_radius
    unit[3 * (section - 1) : 3 * section] = -radius * np.cos(np.deg2rad([0.0, 120.0, 240.0]))
    return unit


def _arc(arm: Arm, q: Array, section: int) -> tuple[float, float, float]:
    """(u, v, l) of a section."""
    a, b, c = q[3 * (section - 1) : 3 * section]
    radius = arm.parameters.sections[section - 1].bellows_radius
    return (b + c - 2 * a) / (3 * radius), (c - b) / (np.sqrt(3) * radius), (a + b + c) / 3


def _angle(arm: Arm, q: Array, section: int) -> tuple[float, float, float]:
    """Bending angle psi, direction phi, and u."""
    u, v, _ = _arc(arm, q, section)
    return float(np.hypot(u, v)), float(np.arctan2(v, u)), float(u)


def _bellows_lengths(arm: Arm, q: Array, section: int) -> Array:
    u, v, length = _arc(arm, q, section)
    bellows = arm.parameters.sections[section - 1].resolved_bellows(section)
    return np.array([length - b.radius * (u * np.cos(b.angle) + v * np.sin(b.angle)) for b in bellows])


def _rest_lengths(arm: Arm, section: int) -> Array:
    return np.array([b.rest_length for b in arm.parameters.sections[section - 1].resolved_bellows(section)])


def _powers(abscissa: Array, law: str, count: int) -> Array:
    exponents = np.arange(1, count + 1) if law == "longitudinal" else 2 * np.arange(count) + 1
    return np.asarray(abscissa[:, None] ** exponents)


def _least_squares(design: Array, target: Array) -> tuple[Array, Array]:
    """Coefficients and their standard errors; columns are scaled, since powers of small numbers differ by orders."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    solution, _, _, _ = np.linalg.lstsq(design / scale, target, rcond=None)
    left = target - design / scale @ solution
    freedom = max(len(target) - design.shape[1], 1)
    covariance = np.linalg.pinv((design / scale).T @ (design / scale)) * float(left @ left) / freedom
    return solution / scale, np.sqrt(np.diag(covariance)) / scale


def _check_section(arm: Arm, section: int) -> None:
    if not 1 <= section <= arm.section_count:
        raise InputError(f"section: {section}; 1 to {arm.section_count} are allowed")
