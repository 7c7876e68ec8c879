"""Random arms as parameter files, so that core and reference read the same text, and random states of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import bha
from bha import reference as ref
from bha.parameters import ArmParameters

Array = NDArray[np.float64]


def fifth_degree(coefficients: Array) -> list[float]:
    """k1, k3 of a bending moment, and a k5."""
    k1, k3 = (float(k) for k in coefficients)
    return [k1, k3, 0.5 * k3 - 0.05]


def random_arm_text(rng: np.random.Generator, sections: int, force_model: str, *, varied: bool = False) -> str:
    """The text of a parameter file of an arm with nothing symmetric about it.

    With ``varied`` it stands somewhere in the world and has sections of several arcs that taper and carry masses.
    """

    def numbers(low: float, high: float, count: int) -> str:
        return str([float(x) for x in rng.uniform(low, high, count)])

    lines = [
        'schema = "bha-arm/1"',
        'name = "random"',
        f"gravity = {numbers(-9.81, 9.81, 3)}",
        f"ambient_pressure = {rng.uniform(9.5e4, 1.05e5)}",
        f'force_model = "{force_model}"',
    ]
    for _ in range(sections):
        lines += [
            "[[section]]",
            f"mass = {rng.uniform(0.2, 1.0)}",
            f"inertia = {numbers(0.002, 0.004, 3)}",
            f"center_of_mass = {numbers(-0.03, 0.03, 3)}",
            f"bellows_radius = {rng.uniform(0.06, 0.12)}",
            "bellows_outer_radius = 0.02",
            f"terminal_area = {rng.uniform(0.0005, 0.003)}",
            f"rest_length = {rng.uniform(0.1, 0.2)}",
            f"stiffness = {[float(x) for x in rng.uniform([500, 500, 5000], [1500, 1500, 12000])]}",
            f"damping = {rng.uniform(4, 20)}",
            f"bending_stiffness = {fifth_degree(rng.uniform([1, 0], [4, 0.3]))}",
            "length_range = [0.1, 0.3]",
            "pressure_range = [0.7e5, 2.2e5]",
            f"base_offset = {rng.uniform(0, 0.03)}",
            f"head_offset = {rng.uniform(0, 0.03)}",
        ]
        if varied:
            lines += _along(rng, areas=force_model == "work_conjugate")
    if varied:
        lines += ["[base]", f"position = {numbers(-1, 1, 3)}", f"rotation = {numbers(-2, 2, 3)}"]
    return "\n".join(lines)


def _along(rng: np.random.Generator, *, areas: bool) -> list[str]:
    """Tables of arcs and masses of a section; some sections have one arc or no masses."""
    count = int(rng.integers(1, 5))
    shares = rng.dirichlet(np.full(count, 3.0), 2)
    lines = []
    for length, bending in shares.T if rng.random() < 0.8 else ():
        lines += ["[[section.arcs]]", f"length = {length}", f"bending = {bending}"]
        lines += [f"relative_radius = {rng.uniform(0.8, 1.2)}"]
        lines += [f"relative_area = {rng.uniform(0.7, 1.3)}"] if areas else []
    for share in rng.choice([0.0, 0.2, 0.5, 0.9, 1.0], int(rng.integers(0, 4)), replace=False):
        lines += ["[[section.masses]]", f"share = {share}", f"mass = {rng.uniform(0.05, 0.3)}"]
        lines += [f"inertia = {[float(x) for x in rng.uniform(5e-4, 2e-3, 3)]}"]
        lines += [f"offset = {[float(x) for x in rng.uniform(-0.03, 0.03, 3)]}"]
    return lines


@dataclass(frozen=True)
class Case:
    """One arm in both implementations, at one state."""

    core: bha.Arm
    reference: ref.Arm
    q: Array
    qd: Array
    p: Array
    f_ext: Array


def random_cases(seed: int, count: int, states_per_arm: int = 25, *, varied: bool = False) -> list[Case]:
    """States of random arms of 1 to 5 sections and both force models; every fifth state is straight or nearly so."""
    rng = np.random.default_rng(seed)
    cases: list[Case] = []
    while len(cases) < count:
        sections = 1 + len(cases) // states_per_arm % 5
        force_model = ("end_force", "work_conjugate")[len(cases) // states_per_arm % 2]
        text = random_arm_text(rng, sections, force_model, varied=varied)
        core = bha.Arm.from_parameters(ArmParameters.from_toml(text))
        reference = ref.parse_arm(text, "random")
        for k in range(min(states_per_arm, count - len(cases))):
            q = rng.uniform(0.1, 0.3, 3 * sections)
            if k % 5 == 0:
                q = np.repeat(q[::3], 3) + rng.choice([0.0, 1e-12, 1e-9, 1e-6, 1e-4]) * rng.normal(size=3 * sections)
            qd, p = rng.uniform(-0.5, 0.5, 3 * sections), rng.uniform(0.7e5, 2.2e5, 3 * sections)
            cases.append(Case(core, reference, q, qd, p, rng.uniform(-3, 3, (sections, 3))))
    return cases
