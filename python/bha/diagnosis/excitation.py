"""What these logs can tell at all: detectable size of every effect, look-alikes, the best next experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from bha.diagnosis.screen import Scored, Screening, Signatures, likenesses

Array = NDArray[np.float64]

#: Likeness from which on two candidates count as one class.
ALIKE = 0.95

#: The experiment that shows a kind best (see docs/guides/diagnosis.md).
EXPERIMENTS: dict[str, str] = {
    "creep": "step and hold one bellows for five of its relaxation times, steps of both signs",
    "hysteresis": "slow triangular pressures of decreasing amplitude at two speeds a factor five apart: "
    "the same loop at both",
    "friction": "free swing until rest, and slow reversals: amplitude falls linearly, "
    "the arm stops off its equilibrium",
    "quadratic_damping": "releases from several amplitudes: the decrement grows with the amplitude",
    "bending_damping": "compare the decay of a lateral swing with that of a bounce along the arm",
    "bending_nonlinear": "quasi-static bends at several mean lengths, up to the largest bend",
    "bending_anisotropy": "bends of one size all around at one mean length: the pressures they need differ by plane",
    "section_coupling": "move one section with the others at constant pressure",
    "effective_area": "pressurise all three bellows of a section against a fixed length",
    "pressure_stiffness": "one bend at two mean pressures, the mean length held by a pull on the arm",
    "weak_bellows": "the same pressure pattern with the tubes of two bellows swapped: the error stays with the bellows",
    "payload": "hang a known mass (50 g) on the head, and swing",
    "base_tilt": "a full turn of the bending plane at two mean lengths: one direction must explain all sections",
    "tool_drag": "the same run with the hose taken off",
    "contact": "the same run with the arm turned about its base",
    "pressure_lag": "log commanded and chamber pressure in one run of steps up and down",
    "delay": "log commanded and chamber pressure, and a tap on the head, on one clock",
    "valve_dead_band": "slow ramps of pressure with reversals of decreasing size",
    "pressure_offset": "all chambers open to the air: the sensors must read ambient pressure",
    "pressure_gain": "one supply pressure on all chambers at several levels",
    "leak": "all valves shut at a raised pressure: a chamber that leaks loses it; soap on the fittings",
    "wire_backlash": "slow triangles of a millimetre: a wire with play stands still at each turn",
    "marker_offset": "a full turn of the bending plane: a marker beside the axis goes round with it",
    "length_offset": "the arm hanging at rest, lengths measured by hand",
    "length_gain": "one bellows moved over its range beside a ruler",
    "work_conjugate": "large bends at constant pressure: the two force models differ by terms in the bend",
    "torsion": "measure the orientation of the heads",
    "taper": "measure head positions at large bends",
    "distributed_mass": "swings along the arm and across it: what lies half way moves half as far",
}


@dataclass(frozen=True)
class Best:
    """The best shape of a kind at a place."""

    index: int
    scored: Scored

    @property
    def is_possible(self) -> bool:
        """Whether it would help, and an arm may have as much of it."""
        own = self.scored
        return own.score > 0.0 and own.candidate.plan.is_plausible(own.strengths, own.candidate.shape)


def best_by_key(screening: Screening, signatures: Signatures) -> dict[tuple[str, str], Best]:
    """Of every kind and place the shape with the best score; a bank looks like what its best element looks like."""
    place = {id(c): k for k, c in enumerate(signatures.candidates)}
    result: dict[tuple[str, str], Best] = {}
    for scored in screening.ranking:
        if not scored.candidate.bank:
            result.setdefault(scored.candidate.key, Best(place[id(scored.candidate)], scored))
    return result


@dataclass(frozen=True)
class Likenesses:
    """How alike all kinds and places look to these data.

    Attributes:
        keys: kinds and places.
        values: greatest canonical correlation of their signatures, shape (m, m).
    """

    keys: tuple[tuple[str, str], ...]
    values: Array

    def alike(self, key: tuple[str, str], least: float = ALIKE) -> list[tuple[str, str, float]]:
        """Kinds and places that these data can hardly tell from ``key``, the most alike first."""
        if key not in self.keys:
            return []
        row = self.values[self.keys.index(key)]
        found = [(*k, float(v)) for k, v in zip(self.keys, row, strict=True) if k != key and v >= least]
        return sorted(found, key=lambda f: -f[2])

    def classes(self, least: float = ALIKE) -> list[list[str]]:
        """Classes of look-alikes: connected by a likeness of ``least`` or more; larger first."""
        _, label = connected_components(csr_matrix((self.values >= least).astype(np.int8)), directed=False)
        groups: dict[int, list[str]] = {}
        for (kind, where), number in zip(self.keys, label, strict=True):
            groups.setdefault(int(number), []).append(f"{kind} at {where}")
        return sorted((g for g in groups.values() if len(g) > 1), key=len, reverse=True)


def compare(screening: Screening, signatures: Signatures, best: dict[tuple[str, str], Best]) -> Likenesses:
    """Likeness of every kind and place to every other, each with its best shape."""
    return Likenesses(tuple(best), likenesses(screening, signatures, [entry.index for entry in best.values()]))


def weakest(best: dict[tuple[str, str], Best], factor: float) -> list[tuple[str, float]]:
    """Kinds by their detectable size over the typical one, the least visible first."""
    table: dict[str, float] = {}
    for (kind, _), entry in best.items():
        strengths = entry.scored.candidate.plan.strengths
        if strengths:
            ratio = 3.0 * entry.scored.deviation * factor / strengths[0].typical
            table[kind] = min(table.get(kind, np.inf), ratio)
    return sorted(((k, float(min(v, 1e6))) for k, v in table.items()), key=lambda f: -f[1])


def next_experiment(kinds: Sequence[str], weak: Sequence[tuple[str, float]]) -> str:
    """The experiment that would tell most: what splits ``kinds``, or shows what these logs hardly see."""
    wanted = [k for k in dict.fromkeys(kinds) if k in EXPERIMENTS]
    if not wanted:
        wanted = [k for k, ratio in weak[:1] if ratio > 0.3]
    return "; ".join(f"{kind}: {EXPERIMENTS[kind]}" for kind in wanted[:3])
