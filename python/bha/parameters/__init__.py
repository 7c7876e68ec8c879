"""Parameter files: the TOML description of an arm, schema ``bha-arm/1``.

``provenance.py`` says where a value comes from, ``bellows.py``, ``section.py``, ``pneumatics.py``, ``sensors.py``,
``effect.py`` and ``arm.py`` are the tables of the file, ``messages.py`` turns what is wrong into errors a person can
act on, ``place.py`` the places that effects name, ``document.py`` writes back without losing comments or order.
"""

from bha.parameters.arm import SCHEMA, ArmParameters, ForceModel, StatedValue
from bha.parameters.bellows import BellowsParameters, ResolvedBellows
from bha.parameters.effect import EFFECT_KINDS, EffectKind, EffectParameter, EffectParameters
from bha.parameters.place import Place
from bha.parameters.pneumatics import PneumaticsLevel, PneumaticsParameters
from bha.parameters.provenance import LogReference, Provenance
from bha.parameters.section import SectionParameters
from bha.parameters.sensors import LengthSensorParameters, SensorsParameters

__all__ = [
    "EFFECT_KINDS",
    "SCHEMA",
    "ArmParameters",
    "BellowsParameters",
    "EffectKind",
    "EffectParameter",
    "EffectParameters",
    "ForceModel",
    "LengthSensorParameters",
    "LogReference",
    "Place",
    "PneumaticsLevel",
    "PneumaticsParameters",
    "Provenance",
    "ResolvedBellows",
    "SectionParameters",
    "SensorsParameters",
    "StatedValue",
]
