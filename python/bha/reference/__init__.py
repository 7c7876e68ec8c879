"""The paper's equations in NumPy, literally: slow, readable, the yardstick of the tests and of the benchmark.

Source: Falkenhahn, Mahl, Hildebrandt, Neumann, Sawodny, "Dynamic Modeling of Bellows-Actuated Continuum Robots Using
the Euler-Lagrange Formalism", IEEE Trans. Robotics 31(6), 2015; every function names its equation. Shares nothing with
the compiled model, not even the reading of parameter files. SI units, base frame (the world where an arm has a base
pose), z along the straight arm.

Where each equation is: (3)-(14) ``kinematics``; (66), (68) ``transformations``; (19)-(21), (63)-(73) ``derivatives``;
(22)-(24), (39) ``homogeneous``; (25)-(35), (52), (53) ``forces``; (48)-(51), (58)-(61) ``dynamics``; (16), (33),
(36)-(38) ``energies``; (17) for any point ``wrenches``; (18), (55)-(57) ``parameters``; (62) ``statics``.
"""

from bha.reference.derivatives import forward_kinematics
from bha.reference.dynamics import (
    DynamicsTerms,
    actuation_force,
    actuation_matrix,
    bias_force,
    coriolis_matrix,
    dynamics_terms,
    forward_dynamics,
    inertia_matrix,
    inverse_dynamics,
)
from bha.reference.energies import Energy, energy
from bha.reference.parameters import Arm, PointMass, Section, SectionArc, load_arm, parse_arm
from bha.reference.simulation import ReferenceTrajectory, right_hand_side, simulate_rk4
from bha.reference.statics import decoupled_static_lengths, static_lengths, static_residual
from bha.reference.wrenches import Wrench

__all__ = [
    "Arm",
    "DynamicsTerms",
    "Energy",
    "PointMass",
    "ReferenceTrajectory",
    "Section",
    "SectionArc",
    "Wrench",
    "actuation_force",
    "actuation_matrix",
    "bias_force",
    "coriolis_matrix",
    "decoupled_static_lengths",
    "dynamics_terms",
    "energy",
    "forward_dynamics",
    "forward_kinematics",
    "inertia_matrix",
    "inverse_dynamics",
    "load_arm",
    "parse_arm",
    "right_hand_side",
    "simulate_rk4",
    "static_lengths",
    "static_residual",
]
