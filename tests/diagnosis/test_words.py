"""A diagnosis in plain words."""

from __future__ import annotations

import pytest

from bha.diagnosis.words import effect_in_words, number
from bha.parameters import EFFECT_KINDS, Place

PLACES = {
    "all": "all",
    "section": "section 2",
    "bellows": "bellows 32",
    "input": "input p13",
    "sensors": "sensors",
    "heads": "heads",
}


@pytest.mark.parametrize("kind", sorted(EFFECT_KINDS))
def test_every_kind_has_a_sentence_at_each_of_its_places(kind: str) -> None:
    info = EFFECT_KINDS[kind]
    for sort in info.places:
        text = effect_in_words(kind, PLACES[sort], {p.name: 0.12 for p in info.parameters})
        assert text
        if kind == "formula":  # its own force is in its table
            continue
        assert info.summary not in text
        place = Place.read(PLACES[sort])
        assert place is not None
        if place.section is not None and sort in ("section", "bellows"):
            assert str(place.section) in text


@pytest.mark.parametrize(
    ("kind", "where", "numbers", "text"),
    [
        ("weak_bellows", "bellows 22", {"change": -0.17}, "bellows 2 of section 2 is 17 % softer than the file says"),
        ("weak_bellows", "section 1", {"change": 0.1}, "the bellows of section 1 are 10 % stiffer than the file says"),
        ("payload", "section 3", {"mass": 0.12}, "the head of section 3 carries 120 g more than the file says"),
        # What acts is the reading and the offset: the sensor reads too low by it.
        ("pressure_offset", "input p12", {"offset": 900.0}, "the pressure sensor of input p12 reads 900 Pa too low"),
        # What is measured is (1 + gain) times the length.
        ("length_gain", "bellows 11", {"gain": 0.02}, "the length sensor of bellows 1 of section 1 reads 2 % too much"),
        ("delay", "sensors", {"time": 0.03}, "the sensors are read 30 ms late"),
        ("delay", "heads", {"time": 0.03}, "the heads are seen 30 ms late"),
        (
            "wire_backlash",
            "bellows 11",
            {"play": 4e-4},
            "the length sensor of bellows 1 of section 1 has 0.4 mm of play to either side",
        ),
        ("leak", "input p12", {"drop": 2e3}, "the pressure of input p12 leaks: at 1 bar 2 kPa less arrive"),
        ("pressure_lag", "all", {"fill": 0.6, "vent": 0.6}, "all pressures lag by 0.6 s"),
        (
            "pressure_lag",
            "input p12",
            {"fill": 0.1, "vent": 0.25},
            "the pressure of input p12 lags: by 100 ms when filling, by 0.25 s when venting",
        ),
        ("base_tilt", "all", {"about_x": 0.0, "about_y": 0.0349066}, "the base stands askew by 2 degrees about y"),
    ],
)
def test_sentences_say_what_a_mechanic_would(kind: str, where: str, numbers: dict[str, float], text: str) -> None:
    assert effect_in_words(kind, where, numbers) == text


def test_a_kind_that_is_not_known_here_keeps_its_name() -> None:
    assert effect_in_words("gremlin", "section 1", {}) == "section 1: gremlin"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(0.0123, "m", "12.3 mm"), (1234.0, "N/m", "1234 N/m"), (2500.0, "Pa", "2.5 kPa"), (-0.05, "", "-5 %")],
)
def test_numbers_come_in_units_that_people_say(value: float, unit: str, text: str) -> None:
    assert number(value, unit) == text
