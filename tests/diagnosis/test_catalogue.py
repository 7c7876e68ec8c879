import bha
from bha.diagnosis import catalogue, places
from bha.parameters.effect import EFFECT_KINDS


def test_every_kind_of_the_registry_is_a_candidate_with_its_own_numbers() -> None:
    # What one chamber takes from another through the supply is kept out, so that something is (docs/decisions/0011);
    # preloads are no cause but what a log begins with (0012).
    assert {plan.kind for plan in catalogue.PLANS} == set(EFFECT_KINDS) - {"formula", "supply_sag", "preload"}
    for plan in catalogue.PLANS:
        known = {number.name for number in EFFECT_KINDS[plan.kind].parameters}
        for shape in plan.shape_grid():
            for numbers, size in plan.probed(shape):
                assert set(numbers) <= known, plan.kind
                assert size > 0.0
        assert set(plan.passive) <= known


def test_places_are_those_of_the_arm() -> None:
    sections = [{"bellows": [{"input": 3 * i + k} for k in range(3)]} for i in range(2)]
    core = {"section": sections, "inputs": ["p11", "p12", "p13", "p21", "p22", "p23"]}
    by_kind = {plan.kind: plan for plan in catalogue.PLANS}
    assert places.places(by_kind["pressure_offset"], core) == [f"input {name}" for name in core["inputs"]]
    assert places.places(by_kind["section_coupling"], core) == ["all"]
    assert places.members("section 2", "input", core) == ["input p21", "input p22", "input p23"]
    assert places.members("all", "bellows", core) == [f"bellows {i}{k}" for i in (1, 2) for k in (1, 2, 3)]


def test_a_place_within_another_is_nested_and_a_neighbour_is_not() -> None:
    sections = [{"bellows": [{"input": 3 * i + k} for k in range(3)]} for i in range(2)]
    core = {"section": sections, "inputs": ["p11", "p12", "p13", "p21", "p22", "p23"]}
    assert places.nested("all", "bellows 21", core)
    assert places.nested("input p12", "section 1", core)
    assert not places.nested("section 2", "bellows 12", core)
    assert not places.nested("input p21", "input p22", core)


def test_what_an_arm_has_is_no_candidate_there_again() -> None:
    january = bha.robots.load("asu_two_section_january").parameters.to_core()
    by_kind = {plan.kind: plan for plan in catalogue.PLANS}
    assert {"section 1", "section 2"}.isdisjoint(places.places(by_kind["effective_area"], january))
    assert "section 1" in places.places(by_kind["creep"], january)


def test_what_no_arm_can_have_is_no_look_alike() -> None:
    plans = {plan.kind: plan for plan in catalogue.PLANS}
    possible = [
        ("payload", (0.1, 0.02, 0.0, -0.01)),
        ("tool_drag", (40.0, 3.0, 0.0, 1.0, 0.2, 0.1)),
        ("base_tilt", (0.2, -0.1)),
        ("pressure_offset", (3e4,)),
        ("pressure_lag", (1.2, 0.7)),
    ]
    impossible = [
        ("payload", (-3.4, 0.0, 0.0, 0.0)),
        ("tool_drag", (12e3, 2.0, 4.0, 4e3, 24.0, 0.0)),
        ("base_tilt", (0.5, -0.2)),
        ("marker_offset", (0.0, 0.0, -0.1)),
    ]
    for kind, strengths in possible:
        assert plans[kind].is_plausible(strengths, {"tau": 0.04}), kind
    for kind, strengths in impossible:
        assert not plans[kind].is_plausible(strengths, {}), kind


def test_a_band_that_takes_noise_off_is_no_candidate() -> None:
    (plan,) = catalogue.beyond_noise(catalogue.available(["valve_dead_band"]), 500.0)
    (shape,) = plan.shapes
    assert shape.grid == (3000.0, 8000.0)
    assert shape.low == 2000.0
    (wide,) = catalogue.beyond_noise(catalogue.available(["valve_dead_band"]), 5000.0)
    assert wide.shapes[0].grid == (20000.0,)
    # Commands have no noise, and other kinds are as they were.
    assert catalogue.beyond_noise([plan], 0.0)[0].shapes[0].grid == shape.grid
    others = catalogue.available(["creep", "pressure_lag"])
    assert catalogue.beyond_noise(others, 500.0) == others
