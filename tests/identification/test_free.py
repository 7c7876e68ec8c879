from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.estimation.free import apply, resolve
from bha.identification import FreeParameter, camera_free, default_free
from bha.parameters import paths

PARAMETERS = bha.robots.parameters("bha_nominal")


def test_value_and_coordinate_are_inverse() -> None:
    free = ["section.1.mass", "section.1.stiffness.2", "gravity.x", "section.*.damping", "section.2.center_of_mass.z"]
    for c in resolve(PARAMETERS, free):
        assert c.value(0.0) == c.start
        for z in (-0.7, 0.3):
            assert c.coordinate(c.value(z)) == pytest.approx(z)
            h = 1e-6
            assert c.slope(z) == pytest.approx((c.value(z + h) - c.value(z - h)) / (2 * h), rel=1e-6)


def test_positive_numbers_are_logarithmic() -> None:
    kinds = {
        c.path: c.logarithmic for c in resolve(PARAMETERS, ["section.1.mass", "section.1.stiffness.2", "gravity.x"])
    }
    assert kinds == {"section.1.mass": True, "section.1.stiffness.2": False, "gravity.x": False}


def test_apply_puts_groups_on_top() -> None:
    free = resolve(PARAMETERS, ["section.*.damping", "section.1.damping"])
    z = np.array([np.log(2.0), np.log(3.0)])
    found = apply(PARAMETERS, free, z)
    assert [paths.get_value(found, f"section.{i}.damping") for i in (1, 2, 3)] == pytest.approx([108.0, 28.0, 20.0])


def test_sessions() -> None:
    free = resolve(
        PARAMETERS,
        [FreeParameter("section.1.rest_length", ("may",)), FreeParameter("section.1.rest_length", ("june",))],
    )
    z = np.array([0.1, 0.2])
    lengths = {s: paths.get_value(apply(PARAMETERS, free, z, s), "section.1.rest_length") for s in ("may", "june", "")}
    assert lengths == pytest.approx({"may": 0.15 * np.exp(0.1), "june": 0.15 * np.exp(0.2), "": 0.15})


def test_same_number_twice_is_an_error() -> None:
    with pytest.raises(bha.InputError, match="free twice"):
        resolve(PARAMETERS, ["section.1.mass", "section.1.mass"])


@pytest.mark.parametrize(
    ("free", "text"),
    [
        (FreeParameter("section.1.mass", lower=1.0), "within its bounds"),
        (FreeParameter("section.1.mass", prior=(0.7, -1.0)), "positive deviation"),
        (FreeParameter("section.1.mass", start=float("nan")), "finite|positive|bounds"),
    ],
)
def test_wrong_free_parameters(free: FreeParameter, text: str) -> None:
    with pytest.raises(bha.InputError, match=text):
        resolve(PARAMETERS, [free])


def test_no_free_parameter() -> None:
    with pytest.raises(bha.InputError, match="no free parameter"):
        resolve(PARAMETERS, [])


def test_defaults_name_what_the_arm_has() -> None:
    names = default_free(PARAMETERS)
    assert len(names) == 18
    assert set(names) <= set(paths.available(PARAMETERS))


def test_a_camera_that_is_published_stays() -> None:
    names = [f.path for f in camera_free(PARAMETERS)]
    assert names == [f"sensors.camera_{key}.{axis}" for key in ("position", "rotation") for axis in "xyz"]
    stated = {"camera_rotation_deg": [0.0, 0.0, 2.0], "provenance": {"camera_rotation_deg": "published"}}
    some = camera_free(PARAMETERS.updated({"sensors": stated}))
    assert [f.path for f in some] == names[:3]
    assert some[0].prior == (0.0, 0.02)
