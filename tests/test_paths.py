"""Numbers of parameter files by their paths."""

from __future__ import annotations

import pytest

import bha
from bha.parameters import ArmParameters, paths


@pytest.mark.parametrize("name", bha.robots.names())
def test_every_number_can_be_changed_alone(name: str) -> None:
    parameters = bha.robots.parameters(name)
    everything = paths.available(parameters)
    assert len(set(everything)) == len(everything)
    before = {path: paths.get_value(parameters, path) for path in everything}
    for path in everything:
        if ".inertia." in path or path.startswith(("section.2", "section.3", "section.4")) or ".bellows.2" in path:
            continue  # lone moments are implausible, which warns; the rest is like what comes before
        # A share at its greatest can only become less.
        value = before[path] * (0.9 if path.endswith(".sharpness") else 1.1) + (0.01 if before[path] == 0 else 0.0)
        changed = paths.with_values(parameters, {path: value})
        assert paths.get_value(changed, path) == value
        assert bha.Arm(changed).parameters == changed
        others = {other for other in everything if paths.get_value(changed, other) != before[other]} - {path}
        # Bellows inherit the section's values, and the moments of inertia may follow from (56).
        name = path.removeprefix("section.1.")
        kept = name.removeprefix("bellows_")
        assert all(other.endswith((name, kept)) or ".inertia." in other for other in others), (path, others)


def test_a_bellows_gets_a_table_of_its_own() -> None:
    parameters = bha.robots.parameters("bha_nominal")
    changed = paths.with_values(parameters, {"section.1.bellows.2.stiffness.1": 900.0})
    assert changed.sections[0].bellows is not None
    assert [b.stiffness for b in changed.sections[0].resolved_bellows(1)] == [
        (1300.0, 1500.0, 12000.0),
        (900.0, 1500.0, 12000.0),
        (1300.0, 1500.0, 12000.0),
    ]
    assert changed.inputs == parameters.inputs


def test_powers_beyond_the_polynomial_are_zero_and_can_be_set() -> None:
    parameters = bha.robots.parameters("asu_two_section")
    assert paths.get_value(parameters, "section.1.stiffness.3") == 0.0
    changed = paths.with_values(parameters, {"section.1.stiffness.3": 5.0})
    assert changed.sections[0].stiffness == (2500.0, 0.0, 5.0)


def test_inertia_follows_the_mass_unless_stated() -> None:
    parameters = bha.robots.parameters("asu_two_section")
    before = paths.get_value(parameters, "section.1.inertia.z")
    heavier = paths.with_values(parameters, {"section.1.mass": 0.58})
    assert paths.get_value(heavier, "section.1.inertia.z") == pytest.approx(2 * before)


def test_groups() -> None:
    parameters = bha.robots.parameters("bha_nominal")
    assert paths.expand(parameters, "section.*.damping") == tuple(f"section.{i}.damping" for i in (1, 2, 3))
    assert len(paths.expand(parameters, "section.*.stiffness.*")) == 9
    with pytest.raises(bha.ParameterError, match="no parameter matches"):
        paths.expand(parameters, "section.*.colour")


@pytest.mark.parametrize(
    ("path", "nearest"),
    [
        ("section.3.mas", "section.3.mass"),
        ("section.9.mass", "section.3.mass"),
        ("gravity.w", "gravity.x"),
        ("section.1.stiffness.9", "section.1.stiffness"),
        ("section.1.bellows.4.damping", "section.1.bellows"),
    ],
)
def test_unknown_paths_name_the_nearest(path: str, nearest: str) -> None:
    with pytest.raises(bha.ParameterError, match="no parameter") as error:
        paths.get_value(bha.robots.parameters("bha_nominal"), path)
    assert path in str(error.value)
    assert nearest.rsplit(".", 1)[0] in str(error.value)


def test_values_that_are_not_allowed() -> None:
    with pytest.raises(bha.ParameterError, match="mass"):
        paths.with_values(bha.robots.parameters("bha_nominal"), {"section.1.mass": -1.0})


def test_units() -> None:
    assert paths.unit_of("section.1.stiffness.2") == "N/m^2"
    assert paths.unit_of("section.1.center_of_mass.z") == "m"
    assert paths.unit_of("section.*.damping") == ""
    assert paths.unit_of("effect.1.stiffness") == ""


def test_changed_sections_are_as_read_from_a_file() -> None:
    """Only sections that change are checked and resolved again; nothing of the old values may stay."""
    base = bha.robots.load("bha_nominal").parameters
    before = base.to_core_json()
    for path in paths.available(base):
        if path.startswith("section."):
            changed = paths.with_values(base, {path: 1.001 * paths.get_value(base, path) + 1e-9})
            again = ArmParameters.from_toml(changed.to_toml())
            assert changed == again, path
            assert changed.to_core_json() == again.to_core_json(), path
            # The file states the inertia, which the radius would else give.
            assert (changed.to_core_json() == before) == path.endswith("outer_radius"), path


def test_a_copied_section_forgets_what_was_resolved() -> None:
    section = bha.robots.load("bha_nominal").parameters.sections[0]
    assert section.resolved_bellows(1)[0].damping == 18.0
    assert section.model_copy(update={"damping": 20.0}).resolved_bellows(1)[0].damping == 20.0
