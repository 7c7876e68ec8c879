"""An arm whose damping outweighs its masses: explicit methods need steps of some microseconds."""

import bha
from bha.parameters import ArmParameters


def stiff_arm(damping: float = 4000.0) -> bha.Arm:
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["name"] = "stiff"
    mapping["section"] = mapping["section"][:2]
    for section in mapping["section"]:
        section["damping"] = damping
        section["mass"] = 0.3
    return bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))
