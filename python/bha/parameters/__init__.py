"""Parameter files: the TOML description of an arm, schema ``bha-arm/1``.

``provenance.py`` says where a value comes from, ``base_pose.py``, ``bellows.py``, ``along.py``, ``section.py``,
``pneumatics.py``, ``sensors.py``, ``effect.py`` and ``arm.py`` are the tables of the file, ``messages.py`` turns what
is wrong into errors a person can act on, ``place.py`` the places that effects name, ``document.py`` writes back without
losing comments or order. A new file comes from what a tape measure tells: ``tape_measure.py``, ``guesses.py`` and
``new_file.py``.
"""

from bha.parameters.along import PointMassParameters, SectionArcParameters
from bha.parameters.arm import SCHEMA, ArmParameters, ForceModel, StatedValue
from bha.parameters.base_pose import BaseParameters
from bha.parameters.bellows import BellowsParameters, ResolvedBellows
from bha.parameters.effect import EFFECT_KINDS, EffectKind, EffectParameter, EffectParameters
from bha.parameters.new_file import new_arm
from bha.parameters.place import Place
from bha.parameters.pneumatics import PneumaticsLevel, PneumaticsParameters
from bha.parameters.provenance import LogReference, Provenance
from bha.parameters.section import SectionParameters
from bha.parameters.sensors import LengthSensorParameters, SensorsParameters
from bha.parameters.tape_measure import MeasuredArm, MeasuredSection

__all__ = [
    "EFFECT_KINDS",
    "SCHEMA",
    "ArmParameters",
    "BaseParameters",
    "BellowsParameters",
    "EffectKind",
    "EffectParameter",
    "EffectParameters",
    "ForceModel",
    "LengthSensorParameters",
    "LogReference",
    "MeasuredArm",
    "MeasuredSection",
    "Place",
    "PneumaticsLevel",
    "PneumaticsParameters",
    "PointMassParameters",
    "Provenance",
    "ResolvedBellows",
    "SectionArcParameters",
    "SectionParameters",
    "SensorsParameters",
    "StatedValue",
    "new_arm",
]
