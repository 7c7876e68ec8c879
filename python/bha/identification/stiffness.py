"""Stiffness from steady states, paper section IV-C and D: one linear least-squares fit per section and law.

In a steady state every section is in balance, N(q, 0) = tau(q, p) (62). Along the direction that lengthens all bellows
of a section alike, what pressure and weight do must be done by the springs; along the direction that bends it, by
springs and bending stiffness. The generalized forces of pressure, weight, springs and bending are those of the core
(``actuation_force``, ``bias_force_parts``), so that both force models and arms with several sections are handled
without a formula of their own. Weight is that of the masses the arm already has.

Limits: masses and terminal areas are taken from the arm; poses must be measured completely. With ``end_force`` a
section above that is bent pushes on this one's head: fit sections from the tip down, each on the arm with those above.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.initial import pose_of
from bha.estimation.records import Record
from bha.estimation.stretches import SteadyState, Stretch, steady_state, steady_states, stretch_of
from bha.parameters import paths
from bha.support.shown import short_repr

Array = NDArray[np.float64]

#: A section that bends by less than this is straight, rad.
STRAIGHT = 0.06
#: Highest power of a spring force curve.
HIGHEST_ORDER = 8
#: Sections above that bend by more than this part of the one that is looked at (and are not straight) push on it.
_SHARE_ABOVE = 0.5
#: Bending away from the plane phi = 0 or pi that still counts as in it, rad.
IN_PLANE = 0.2


@short_repr
@dataclass(frozen=True)
class StiffnessFit:
    """A law of one section fitted to steady states; ready to be plotted as Fig. 8 or Fig. 9.

    Attributes:
        section: number of the section, from 1.
        law: ``"longitudinal"`` or ``"bending"``.
        rest_length: mean rest length of its bellows, m: the zero of the curve where that was found, else the arm's.
        rest_shift: how far the zero of the curve lies from the arm's rest lengths, m, and its standard error; None
            where these were taken.
        offset: moment that stays at angle zero, N m (bellows that are not alike); 0 for springs.
        pressure_per_moment: pressure p that bends by one N m if bellows k has -p cos(a_k), Pa/(N m): the relative
            bending pressure of Fig. 9.
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
    rest_length: float
    rest_shift: tuple[float, float] | None
    offset: float
    pressure_per_moment: float
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
        return _powers(abscissa, self.law, len(self.coefficients)) @ self.coefficients + self.offset

    @property
    def entries(self) -> dict[str, tuple[float, float]]:
        """Numbers of a parameter file that are found, by path, with their standard errors; no rest lengths."""
        pairs = zip(map(float, self.coefficients), map(float, self.standard_errors), strict=True)
        return dict(zip(self.paths, pairs, strict=True))

    def applied(self, arm: Arm) -> Arm:
        """The arm with these coefficients and rest lengths; terms of the old law beyond them become zero."""
        mapping = arm.parameters.to_mapping()
        table = mapping["section"][self.section - 1]
        key = "stiffness" if self.law == "longitudinal" else "bending_stiffness"
        found = [float(c) for c in self.coefficients]
        tables = [table]
        if self.law == "longitudinal":
            tables += [bellows for bellows in table.get("bellows", ()) if "stiffness" in bellows]
        for each in tables:
            each[key] = found + [0.0] * (len(each[key]) - len(found))
            each.get("provenance", {}).pop(key, None)
        if self.rest_shift is not None:
            for each in [table, *(b for b in table.get("bellows", ()) if "rest_length" in b)]:
                each["rest_length"] = each["rest_length"] + self.rest_shift[0]
                each.get("provenance", {}).pop("rest_length", None)
        return Arm(arm.parameters.updated(mapping))


def longitudinal_stiffness(
    arm: Arm,
    records: Sequence[Record],
    section: int,
    *,
    order: int = 3,
    rest_length: bool | None = None,
    straight: float = STRAIGHT,
    holds: Sequence[Stretch] | None = None,
) -> StiffnessFit:
    """Spring force curve of a section's bellows from its even elongations (Fig. 8).

    Args:
        arm: geometry, masses, areas; its own stiffness does not matter.
        records: logs; their steady states with the section, and those above it, straight are used.
        section: number of the section, from 1.
        order: highest power of (length - rest length), 1 to 8.
        rest_length: whether the rest length is found too, as the zero of the curve, or is the arm's; found where the
            spring forces change sign if None.
        straight: greatest bending angle that counts as straight, rad.
        holds: where nothing moves; found in the logs if None.

    Raises:
        InputError: too few steady states at different lengths, or a curve without a zero.
    """
    _check_section(arm, section)
    if not 1 <= order <= HIGHEST_ORDER:
        raise InputError(f"order: {order}; 1 to {HIGHEST_ORDER} are allowed")
    # All springs of the section pull alike: the sum over its three coordinates of what they must hold, over their
    # number.
    bare = _bare(arm, section, springs=False, bending=True)
    unit = _unit_elongation(arm, section)
    rows: list[_Row] = []
    for rec, state, q in _steady(arm, records, holds):
        if max(_angle(bare, q, k)[0] for k in range(section, arm.section_count + 1)) > straight:
            continue
        elongations = _bellows_lengths(bare, q, section) - _rest_lengths(arm, section)
        rows.append((elongations, float(_held(bare, rec, state, q) @ unit), state))
    needed = np.array([n for _, n, _ in rows])
    found = rest_length if rest_length is not None else len(rows) > 0 and bool(needed.min() < 0.0 < needed.max())
    least = order + 1 + found
    if len({round(float(np.mean(r[0])), 4) for r in rows}) < least:
        law = f"a law of order {order}" + (" and a rest length" if found else "")
        raise InputError(
            f"section {section}: {len(rows)} steady states with it straight (below {straight} rad), too few lengths "
            f"for {law}; inflate all of its bellows evenly, in at least {least} steps, and hold each for a second"
        )
    first = 0 if found else 1
    sums = [np.sum(elongations[:, None] ** np.arange(first, order + 1), axis=0) for elongations, _, _ in rows]
    coefficients, covariance = _least_squares(np.array(sums), needed)
    mean = np.array([float(np.mean(e)) for e, _, _ in rows])
    shift = None
    if found:
        around = float(mean[np.argmin(np.abs(needed))])
        zero, coefficients, covariance = _about_its_zero(coefficients, covariance, around, section)
        shift, mean = (zero, float(np.sqrt(covariance[0, 0]))), mean - zero
        covariance = covariance[1:, 1:]
    fit = _fit(arm, section, "longitudinal", coefficients, covariance, mean, needed / len(rows[0][0]), rows)
    return fit if shift is None else replace(fit, rest_shift=shift, rest_length=fit.rest_length + shift[0])


def bending_stiffness(
    arm: Arm,
    records: Sequence[Record],
    section: int,
    *,
    cubic: bool = False,
    offset: bool | None = None,
    straight: float = STRAIGHT,
    in_plane: float = IN_PLANE,
    holds: Sequence[Stretch] | None = None,
) -> StiffnessFit:
    """Bending moment of a section from poses with phi = 0 or pi (Fig. 9): bellows 2 and 3 evenly against bellows 1.

    Longitudinal springs and weight are taken off with the arm's values: fit :func:`longitudinal_stiffness` first.

    Args:
        arm: geometry, masses, areas, springs.
        records: logs; their steady states with the section straight or bent in its plane are used, unless a section
            above is bent more than half as much.
        section: number of the section, from 1.
        cubic: whether to fit k3 too; the paper fits a line.
        offset: whether a moment may stay at angle zero, as bellows that are not quite alike make it; where poses are
            bent to both sides if None.
        straight: bending angles below this are straight, rad: the same moment, whatever phi.
        in_plane: greatest distance of phi from 0 or pi, rad.
        holds: where nothing moves; found in the logs if None.

    Raises:
        InputError: too few steady states.
    """
    _check_section(arm, section)
    bare = _bare(arm, section, springs=True, bending=False)
    unit = _unit_bend(arm, section)
    rows: list[_Row] = []
    bent = 0
    for rec, state, q in _steady(arm, records, holds):
        psi, phi, u = _angle(bare, q, section)
        if psi >= straight and abs(np.sin(phi)) > np.sin(in_plane):
            continue
        above = [_angle(bare, q, k)[0] for k in range(section + 1, arm.section_count + 1)]
        if max(above, default=0.0) > max(straight, _SHARE_ABOVE * psi):
            continue
        bent += psi >= straight
        rows.append((np.array([u]), float(_held(bare, rec, state, q) @ unit), state))
    terms = 2 if cubic else 1
    angles = np.array([float(u[0]) for u, _, _ in rows])
    both = bool(np.any(angles <= -straight) and np.any(angles >= straight))
    if bent < terms + 1 or (offset and not both):
        sides = " to both sides" if offset else ""
        raise InputError(
            f"section {section}: {bent} steady states with it bent{sides} in its plane (phi = 0 or pi within "
            f"{in_plane} rad); at least {terms + 1} are needed{sides}: pressurize bellows 2 and 3 evenly against "
            "bellows 1, to either side, and hold each step for a second"
        )
    with_offset = both if offset is None else offset
    if not with_offset:  # nothing but the offset is told by straight poses
        rows = [row for row, angle in zip(rows, angles, strict=True) if abs(angle) >= straight]
        angles = np.array([float(u[0]) for u, _, _ in rows])
    moments = np.array([m for _, m, _ in rows])
    design = _powers(angles, "bending", terms)
    if with_offset:
        design = np.column_stack([design, np.ones(len(angles))])
    coefficients, covariance = _least_squares(design, moments)
    fit = _fit(arm, section, "bending", coefficients[:terms], covariance[:terms, :terms], angles, moments, rows)
    left = float(coefficients[terms]) if with_offset else 0.0
    return replace(fit, offset=left, residual=fit.residual - left)


#: Elongations of the bellows or the angle, what must be held, and where.
_Row = tuple[Array, float, SteadyState]


def _fit(
    arm: Arm,
    section: int,
    law: str,
    coefficients: Array,
    covariance: Array,
    abscissa: Array,
    ordinate: Array,
    rows: Sequence[_Row],
) -> StiffnessFit:
    bellows = arm.parameters.sections[section - 1].resolved_bellows(section)
    lever = sum(b.terminal_area * b.radius * np.cos(b.angle) ** 2 for b in bellows)
    return StiffnessFit(
        section=section,
        law=law,
        rest_length=float(np.mean(_rest_lengths(arm, section))),
        rest_shift=None,
        offset=0.0,
        pressure_per_moment=float(1.0 / lever) if lever > 0.0 else float("nan"),
        coefficients=coefficients,
        standard_errors=np.sqrt(np.diag(covariance)),
        abscissa=abscissa,
        ordinate=ordinate,
        residual=ordinate - _powers(abscissa, law, len(coefficients)) @ coefficients,
        used=tuple(state.stretch for _, _, state in rows),
        drift=np.array([state.drift for _, _, state in rows]),
    )


def _about_its_zero(coefficients: Array, covariance: Array, around: float, section: int) -> tuple[float, Array, Array]:
    """The zero of a polynomial nearest to ``around``, its coefficients about it, and the covariance of both.

    Raises:
        InputError: it has no zero.
    """
    polynomial = np.polynomial.Polynomial(coefficients)
    roots = [float(root.real) for root in polynomial.roots() if abs(root.imag) < 1e-9]
    if not roots:
        raise InputError(
            f"section {section}: the curve through the steady states has no zero; a law of odd order has one, or hold "
            "it at lengths on both sides of its rest length"
        )
    zero = min(roots, key=lambda root: abs(root - around))
    order = len(coefficients) - 1
    own = [polynomial.deriv(j)(zero) / math.factorial(j) if j else 0.0 for j in range(order + 1)]
    # First-order propagation: the zero moves by -f / f', coefficient j by Taylor's formula and with the zero.
    moves = -(zero ** np.arange(order + 1)) / own[1]
    change = np.zeros((order + 1, order + 1))
    change[0] = moves
    for j in range(1, order + 1):
        change[j] = [math.comb(i, j) * zero ** (i - j) if i >= j else 0.0 for i in range(order + 1)]
        if j < order:
            change[j] += (j + 1) * own[j + 1] * moves
    return zero, np.array(own[1:]), change @ covariance @ change.T


def _steady(
    arm: Arm, records: Sequence[Record], holds: Sequence[Stretch] | None
) -> list[tuple[Record, SteadyState, Array]]:
    """Steady states with the pose in each, by least squares on the means of what was measured.

    The means matter: a spring force is the difference of large forces, and noise of the pose that is in both what the
    law explains and what it is made of would flatten the law. Of what is found the last half is used: lags have passed.
    """
    found = []
    for rec in records:
        if holds is None:
            halves = [s.stretch for s in steady_states(arm, rec)]
            own = [stretch_of(rec, (s.first + s.last) // 2, s.last) for s in halves]
        else:
            own = [stretch for stretch in holds if stretch.record == rec.name]
        for stretch in own:
            state = steady_state(arm, rec, stretch)
            deviation = rec.noise / np.sqrt(stretch.last - stretch.first)
            found.append((rec, state, pose_of(arm, rec, state.channels, deviation, state.pressures)))
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
    """Coefficients and their covariance; columns are scaled, since powers of small numbers differ by orders."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    solution, _, _, _ = np.linalg.lstsq(design / scale, target, rcond=None)
    left = target - design / scale @ solution
    freedom = max(len(target) - design.shape[1], 1)
    covariance = np.linalg.pinv((design / scale).T @ (design / scale)) * float(left @ left) / freedom
    return solution / scale, covariance / np.outer(scale, scale)


def _check_section(arm: Arm, section: int) -> None:
    if not 1 <= section <= arm.section_count:
        raise InputError(f"section: {section}; 1 to {arm.section_count} are allowed")
