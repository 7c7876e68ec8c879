"""Kinetic energies (16), (36)-(38) and potentials (33) of a state.

Frame: the world's; the gravitational potential is zero at its origin, which is the base's unless the arm has a base
pose. Units: J. The springs' potential is not in the paper, which counts them among the forces; it is the integral of
F_spr, and only with ``work_conjugate`` is it what the springs give back around a closed path.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from bha.reference.arguments import vector
from bha.reference.derivatives import position, position_derivative, transformations
from bha.reference.forces import bending_moment
from bha.reference.homogeneous import Array, inertia_in_base_frame, rotation_rate
from bha.reference.parameters import Arm, Section


@dataclasses.dataclass(frozen=True)
class Energy:
    """Energies of one state, J."""

    kinetic_translational: float
    kinetic_rotational: float
    potential_gravity: float
    potential_bending: float
    potential_springs: float
    potential_axial: float = 0.0

    @property
    def kinetic(self) -> float:
        """Equation (36)."""
        return self.kinetic_translational + self.kinetic_rotational

    @property
    def potential(self) -> float:
        """Equation (33), the springs, and what holds the mean lengths."""
        return self.potential_gravity + self.potential_bending + self.potential_springs + self.potential_axial

    @property
    def total(self) -> float:
        """Sum of all."""
        return self.kinetic + self.potential


def energy(arm: Arm, q: Array, qd: Array) -> Energy:
    """Energies at lengths q (3n,) m and rates qd (3n,) m/s; rotational energy is 0 where the arm leaves it out (58)."""
    q, qd = vector(arm, "q", q), vector(arm, "qd", qd)
    state = transformations(arm, q)
    trans = rot = grav = bend = springs = axial = 0.0
    for body in state.bodies:
        H_dot = np.tensordot(qd[: len(body.dH)], body.dH, 1)  # (70)
        velocity = position_derivative(H_dot, body.r_S)
        trans += 0.5 * body.mass * float(velocity @ velocity)  # (37)
        if arm.rotational_energy:
            omega = rotation_rate(body.H, H_dot)
            rot += 0.5 * float(omega @ inertia_in_base_frame(body.H, body.inertia_tensor) @ omega)  # (38)
        grav -= body.mass * float(np.array(arm.gravity) @ position(body.H, body.r_S))
    for i, section in enumerate(arm.sections):
        bend += bending_potential(section, state.x[i])
        springs += spring_potential(section.stiffness, q[3 * i : 3 * i + 3] - section.rest_length)
        axial += spring_potential(section.axial_stiffness, state.x[i][2] - section.axial_rest_length)
    return Energy(trans, rot, grav, bend, springs, axial)


def bending_potential(section: Section, x: Array) -> float:
    """U_bend of (33) as the integral of the bending moment M_bend(psi, phi) over psi, J; x = (u, v, l)."""
    psi = float(np.hypot(x[0], x[1]))
    phi = math.atan2(x[1], x[0])
    # The moment is an odd polynomial of the fifth degree, which three points integrate exactly (Gauss-Legendre).
    points, weights = np.polynomial.legendre.leggauss(3)
    angles = psi / 2 * (points + 1)
    moments = [bending_moment(section, angle, (math.cos(phi), math.sin(phi))).real for angle in angles]
    return float(psi / 2 * weights @ np.array(moments))


def spring_potential(stiffness: tuple[float, ...], extension: Array) -> float:
    """Integral of a spring force (26) from rest, summed over the extensions, J."""
    powers = [k / (j + 1) * extension ** (j + 1) for j, k in enumerate(stiffness, start=1)]
    return float(np.sum(powers))
