"""Arms and states for the tests of the reference model."""

from __future__ import annotations

import dataclasses
import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference_states import State, random_state, straight_state

from bha import reference as ref

ORACLE = Path(__file__).parents[1] / "data" / "oracle_cases.json.gz"


@pytest.fixture(scope="session")
def oracle() -> dict[str, Any]:
    return json.loads(gzip.decompress(ORACLE.read_bytes()))


@pytest.fixture(scope="session")
def arms(oracle: dict[str, Any]) -> dict[str, ref.Arm]:
    return {name: ref.parse_arm(text, name) for name, text in oracle["arms"].items()}


@pytest.fixture(scope="session")
def arm(arms: dict[str, ref.Arm]) -> ref.Arm:
    """Three unequal sections with rigid pieces: nothing in it is symmetric."""
    sections = [
        dataclasses.replace(section, base_offset=0.01 * (i + 1), head_offset=0.02 - 0.005 * i)
        for i, section in enumerate(arms["random_3"].sections)
    ]
    return dataclasses.replace(arms["random_3"], sections=tuple(sections))


@pytest.fixture(params=["bent", "straight", "nearly straight"])
def state(request: pytest.FixtureRequest) -> State:
    """One state of a three-section arm, bent, straight, or 1e-7 m from straight."""
    if request.param == "bent":
        return random_state(3, 1)
    straight = straight_state(3, 2)
    if request.param == "straight":
        return straight
    return dataclasses.replace(straight, q=straight.q + 1e-7 * np.array([1, -2, 0.5, 0, 1, -1, 2, 0.3, 1]))
