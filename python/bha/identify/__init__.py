"""Identification: from measured logs to the parameters of an arm, with how well they are known.

``identify`` does the whole of it. Its parts: ``record`` (logs as residuals see them), ``refine`` (joint fit by output
error), ``identification`` (what is known and what is left), ``predict`` (held-out logs); the paper's procedures of
section IV, each on its own, are ``inertia``, ``longitudinal_stiffness``, ``bending_stiffness`` and ``swing_damping``.
"""

from bha.identify.free import FreeParameter, default_free
from bha.identify.holdout import Prediction, predict
from bha.identify.identifiability import Combination, unknown_combinations
from bha.identify.records import Record, frozen_spans, record
from bha.identify.refine import Refinement, Settings, refine
from bha.identify.residuals import ChannelResidual
from bha.identify.result import Estimate, HeldOut, Identification, identification

__all__ = [
    "ChannelResidual",
    "Combination",
    "Estimate",
    "FreeParameter",
    "HeldOut",
    "Identification",
    "Prediction",
    "Record",
    "Refinement",
    "Settings",
    "default_free",
    "frozen_spans",
    "identification",
    "predict",
    "record",
    "refine",
    "unknown_combinations",
]
