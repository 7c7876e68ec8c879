"""Identification: from measured logs to the parameters of an arm, with how well they are known.

``identify`` does the whole of it. Its parts: ``record`` (logs as residuals see them), ``refine`` (joint fit by output
error), ``identification`` (what is known and what is left), ``predict`` (held-out logs); ``fit_poses`` fits what a slow
arm tells. The paper's procedures of section IV, each on its own, are ``inertia``, ``longitudinal_stiffness``,
``bending_stiffness`` and ``swing_damping``, and ``carry_out`` for all sections of an arm; ``excite`` proposes what to
measure.
"""

from bha.estimation.free import FreeParameter, camera_free, default_free
from bha.estimation.preload import with_preloads
from bha.estimation.records import Record, record
from bha.estimation.refinement import Refinement, refine
from bha.estimation.settings import Settings
from bha.estimation.static_fit import StaticFit, fit_poses
from bha.estimation.stretches import SteadyState, Stretch, steady_states, swings
from bha.identification.excitation import Excitation, excite
from bha.identification.holdout import Prediction, predict
from bha.identification.identifiability import Combination, unknown_combinations
from bha.identification.moments import Inertia, inertia
from bha.identification.procedures import NEEDS, PROCEDURES, Procedure, carry_out
from bha.identification.residuals import ChannelResidual
from bha.identification.result import Estimate, HeldOut, Identification, identification
from bha.identification.stiffness import StiffnessFit, bending_stiffness, longitudinal_stiffness
from bha.identification.swing import FreeSwing, Oscillation, SwingFit, oscillation, swing_damping
from bha.identification.workflow import identify

__all__ = [
    "NEEDS",
    "PROCEDURES",
    "ChannelResidual",
    "Combination",
    "Estimate",
    "Excitation",
    "FreeParameter",
    "FreeSwing",
    "HeldOut",
    "Identification",
    "Inertia",
    "Oscillation",
    "Prediction",
    "Procedure",
    "Record",
    "Refinement",
    "Settings",
    "StaticFit",
    "SteadyState",
    "StiffnessFit",
    "Stretch",
    "SwingFit",
    "bending_stiffness",
    "camera_free",
    "carry_out",
    "default_free",
    "excite",
    "fit_poses",
    "identification",
    "identify",
    "inertia",
    "longitudinal_stiffness",
    "oscillation",
    "predict",
    "record",
    "refine",
    "steady_states",
    "swing_damping",
    "swings",
    "unknown_combinations",
    "with_preloads",
]
