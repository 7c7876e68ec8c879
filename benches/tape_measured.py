"""The arm of benches.real_arm as a stranger has it: a tape measure, a scale, and the tubes as its authors name them.

What `bha new` makes of the measures that come with the logs: lengths at 0 psi and with all chambers at 15 psi, wires
43 mm apart, plates, and 0.29 kg a section. Sections are fed as the logs show (`bha check`): the first by p21 to p23.
"""

from __future__ import annotations

import tomllib

import bha
from bha.parameters import ArmParameters
from bha.parameters.new_file import new_arm
from bha.parameters.tape_measure import MeasuredArm, MeasuredSection

#: Tubes of the bellows of each section, from the one at -x on.
TUBES = (("p21", "p23", "p22", "p23"), ("p11", "p13", "p12", "p13"))


def tape_measured() -> bha.Arm:
    """The arm."""
    alike = {"radius": 0.0215, "diameter": 0.03, "mass": 0.29, "bellows": 4, "first_angle_deg": 180.0}
    sections = (
        MeasuredSection(length=0.085, longest=0.19, base_offset=0.037, head_offset=0.032, **alike),
        MeasuredSection(length=0.065, longest=0.18, base_offset=0.022, head_offset=0.046, **alike),
    )
    mapping = tomllib.loads(new_arm(MeasuredArm("asu", sections, pressure_max=1.1e5)))
    for section, tubes in zip(mapping["section"], TUBES, strict=True):
        for bellows, tube in zip(section["bellows"], tubes, strict=True):
            bellows["input"] = tube
    return bha.Arm(ArmParameters.from_mapping(mapping))
