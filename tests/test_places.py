"""Places read back to what they were written from, nothing else is one, and a place knows its parts."""

import pytest

import bha
from bha.errors import ParameterError
from bha.parameters import Place

PLACES = (
    Place(),
    Place("sensors"),
    *(Place.of_section(i) for i in (1, 9, 10, 123)),
    *(Place.of_bellows(i, k) for i in (1, 9, 10) for k in (1, 9, 10, 12)),
    *(Place.of_input(name) for name in ("p11", "p10_2", "p1_12")),
)
INPUTS = (("p11", "p12", "p13"), ("p21", "p21", "p22", "p22"))


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_places_read_back(place: Place) -> None:
    assert Place.read(str(place)) == place


def test_as_files_have_them() -> None:
    assert [str(p) for p in (Place(), Place("sensors"), Place.of_section(2))] == ["all", "sensors", "section 2"]
    assert [str(p) for p in (Place.of_bellows(3, 2), Place.of_bellows(10, 2))] == ["bellows 32", "bellows 10_2"]
    assert str(Place.of_input("p13")) == "input p13"
    assert Place.read("bellows 3_2") == Place.of_bellows(3, 2)


@pytest.mark.parametrize(
    "text",
    ["", "tip", "All", "all ", "section", "section 0", "section 02", "section 2 ", "section 1.5", "section ١",
     "bellows 3", "bellows 30", "bellows 321", "bellows 0_1", "bellows 3_",
     "input", "input q11", "input p", "sensors "],
)  # fmt: skip
def test_what_is_no_place(text: str) -> None:
    assert Place.read(text) is None


def test_parts() -> None:
    def parts(place: Place, sort: str) -> list[str]:
        return [str(part) for part in place.parts(sort, INPUTS)]

    assert parts(Place(), "section") == ["section 1", "section 2"]
    assert parts(Place(), "bellows") == [f"bellows {pair}" for pair in (11, 12, 13, 21, 22, 23, 24)]
    assert parts(Place.of_section(2), "input") == ["input p21", "input p22"]
    assert parts(Place.of_section(2), "bellows")[-1] == "bellows 24"
    assert parts(Place.of_bellows(1, 2), "input") == ["bellows 12"]
    assert parts(Place.of_input("p21"), "bellows") == ["input p21"]
    assert parts(Place("sensors"), "") == ["sensors"]


def test_one_bellows_written_in_two_ways_is_one_place() -> None:
    arm = bha.robots.load("bha_nominal")
    creep = {"kind": "creep", "stiffness": 10.0, "tau": 1.0}
    with pytest.raises(ParameterError, match='"length_gain" at "bellows 1_2" is already effect 1'):
        arm.with_effects([{"kind": "length_gain", "where": w, "gain": 0.1} for w in ("bellows 12", "bellows 1_2")])
    # The core reads both alike.
    one, other = (arm.with_effects([{**creep, "where": where}]) for where in ("bellows 12", "bellows 1_2"))
    drive = bha.Input.constant([1.2e5] + [1.0e5] * (len(arm.inputs) - 1), 0.2)
    q = arm.static_lengths(drive.pressures[0]) + 1e-3
    assert bha.simulate(one, drive, q0=q, dt=0.1).lengths.tolist() == (
        bha.simulate(other, drive, q0=q, dt=0.1).lengths.tolist()
    )
