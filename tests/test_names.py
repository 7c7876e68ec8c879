"""Names of quantities read back to what they were made from, and nothing else does."""

import pytest

from bha import names
from bha.names import Quantity, quantity

NUMBERS = (1, 2, 9, 10, 11, 99, 123)


def test_names_read_back() -> None:
    made: dict[str, Quantity] = {names.TIME: Quantity("time")}
    for section in NUMBERS:
        for number in NUMBERS:
            made[names.pressure_name(section, number)] = Quantity("pressure", section, number)
            made[names.commanded_pressure_name(section, number)] = Quantity("commanded_pressure", section, number)
        for number in range(1, 13):
            made[names.length_name(section, number)] = Quantity("length", section, number)
            made[names.velocity_name(section, number)] = Quantity("velocity", section, number)
        for number in (1, 2, 3):
            made[names.coordinate_name(section, number)] = Quantity("coordinate", section, number)
            made[names.coordinate_velocity_name(section, number)] = Quantity("coordinate_velocity", section, number)
        for entry, name in enumerate(names.orientation_names(section), start=1):
            made[name] = Quantity("orientation", section, entry)
        for axis, (position, force) in enumerate(
            zip(names.position_names(section), names.force_names(section), strict=True), start=1
        ):
            made[position] = Quantity("position", section, axis)
            made[force] = Quantity("force", section, axis)
    count = len(NUMBERS) * (2 * len(NUMBERS) + 2 * 12 + 2 * 3 + 4 + 2 * 3) + 1
    assert len(made) == count, "no two quantities share a name"
    for name, meant in made.items():
        assert quantity(name) == meant


@pytest.mark.parametrize(
    "name",
    [
        "",
        "T",
        "p",
        "p1",
        "p 11",
        "p1_1",
        "p01",
        "p10",
        "p111",
        "p1_01",
        "P11",
        "q1_13",
        "qd10_13",
        "qv14",
        "qvd1_4",
        "qv",
        "o1",
        "ow0",
        "ow",
        "ov1",
        "x0",
        "x",
        "fx",
        "pcc11",
    ],
)
def test_other_names_stand_for_nothing(name: str) -> None:
    assert quantity(name) is None
