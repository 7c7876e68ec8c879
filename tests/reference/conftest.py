"""Arms and states for the tests of the reference model."""

from __future__ import annotations

import dataclasses
import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference_states import State, random_state, straight_state, with_arcs

from bha import reference as ref

ORACLE = Path(__file__).parents[1] / "data" / "oracle_cases.json.gz"


@pytest.fixture(scope="session")
def oracle() -> dict[str, Any]:
    return json.loads(gzip.decompress(ORACLE.read_bytes()))


@pytest.fixture(scope="session")
def arms(oracle: dict[str, Any]) -> dict[str, ref.Arm]:
    return {name: ref.parse_arm(text, name) for name, text in oracle["arms"].items()}


@pytest.fixture(scope="session", params=["one arc", "several arcs"])
def arm(request: pytest.FixtureRequest, arms: dict[str, ref.Arm]) -> ref.Arm:
    """Three unequal sections with rigid pieces: nothing in it is symmetric.

    As in the paper, or somewhere in the world with two sections of several arcs and with masses along them.
    """
    sections = [
        dataclasses.replace(section, base_offset=0.01 * (i + 1), head_offset=0.02 - 0.005 * i)
        for i, section in enumerate(arms["random_3"].sections)
    ]
    if request.param == "one arc":
        return dataclasses.replace(arms["random_3"], sections=tuple(sections))
    sections[0] = with_arcs(sections[0])
    sections[2] = dataclasses.replace(
        with_arcs(sections[2], bending=(0.2, 0.5, 0.3)), masses=(ref.PointMass(0.7, 0.2, offset=(0.0, 0.01, 0.0)),)
    )
    masses = (ref.PointMass(0.25, 0.1), ref.PointMass(1.0, 0.15, (1e-3, 2e-3, 3e-3), (0.02, -0.01, 0.03)))
    sections[1] = dataclasses.replace(sections[1], masses=masses)
    base = {"base_position": (0.3, -0.2, 1.1), "base_rotation": (0.4, -0.7, 1.9)}
    return dataclasses.replace(arms["random_3"], sections=tuple(sections), **base)


@pytest.fixture(params=["bent", "straight", "nearly straight"])
def state(request: pytest.FixtureRequest) -> State:
    """One state of a three-section arm, bent, straight, or 1e-7 m from straight."""
    if request.param == "bent":
        return random_state(3, 1)
    straight = straight_state(3, 2)
    if request.param == "straight":
        return straight
    return dataclasses.replace(straight, q=straight.q + 1e-7 * np.array([1, -2, 0.5, 0, 1, -1, 2, 0.3, 1]))
