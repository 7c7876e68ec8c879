"""What a residual force follows: curves over length, rate and pressure of the bellows, chosen by leaving out logs.

What: the force along the coordinates is regressed on straight-line curves of each bellows' own length, rate and
pressure; which variables, and whether the bellows of a section share curves, is what predicts a log best that took no
part (thirds of a single one). The simplest counts that comes near the best.
Deviations of the curves: residuals over blocks of time are what they are, however they are correlated (sandwich).
Limits: the sum of curves of one variable each: no product of them, no memory, no time. What is held out of a diagnosis
is held out here too: it certifies by simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.diagnosis.force import ResidualForce, length_rows
from bha.diagnosis.force_table import Bellows, Curve, ResidualTable, Variable
from bha.parameters import Place

Array = NDArray[np.float64]

#: Quantiles of a variable between which a curve is known, and its nodes: shares of that range (rates: of each side).
KNOWN = (0.005, 0.995)
NODES, RATE_NODES = tuple(np.linspace(0.0, 1.0, 7).tolist()), (0.0, 0.5, 0.85, 1.0)
#: Weight of the curves' bends and of their sizes against the readings: enough to make nodes without any follow their
#: neighbours, and to keep curves over what moves together (length and pressure of an arm at rest) from cancelling.
SMOOTHNESS = 1e-3
#: Least share of the force's mean square on logs left out that curves must explain, and share of the best's that the
#: simplest may lack.
LEAST_EXPLAINED, NEAR = 0.2, 0.03
#: Length of the blocks that err on their own, in correlation times of the force.
BLOCK = 4.0
#: Parts of a single log that are left out in turn.
PARTS = 3


@dataclass(frozen=True)
class Law:
    """Curves that a residual force follows.

    Attributes:
        tables: the curves.
        explained: share of the force's mean square that such curves explain on logs that took no part.
        variables: over which they are.
        shared: whether the bellows of a section have the same ones.
    """

    tables: list[Bellows]
    explained: float
    variables: tuple[Variable, ...]
    shared: bool


@dataclass(frozen=True)
class _Rows:
    """Rows of one log: forces along the coordinates, and each bellows' own length, rate and pressure.

    Attributes:
        force: N, shape (K, m).
        known: variable -> values of each bellows, shape (K, bellows).
        step: between rows, s.
    """

    force: Array
    known: dict[str, Array]
    step: float


def follow(found: ResidualForce, logs: Sequence[int]) -> Law | None:
    """The curves that the force follows along some of its logs; None if it follows none of these variables."""
    lengths = length_rows(found.arm)
    inputs = inputs_of(found.arm)
    rows = [_rows(found, log, lengths, inputs) for log in logs]
    parts = _parts(rows)
    every: tuple[Variable, ...] = ("q", "qd", "p")
    choices = [
        (variables, shared) for shared in (True, False) for n in (1, 2, 3) for variables in combinations(every, n)
    ]
    whole = float(np.mean([np.mean(part.force**2) for part in parts]))
    scored = []
    for variables, shared in choices:
        basis = _Basis(found, lengths, rows, variables, shared=shared)
        errors = []
        for k, part in enumerate(parts):
            values, _ = basis.fit([p for j, p in enumerate(parts) if j != k])
            errors.append(np.mean((part.force - basis.force(part, values)) ** 2))
        scored.append((1.0 - float(np.mean(errors)) / max(whole, 1e-300), basis))
    best = max(score for score, _ in scored)
    if best < LEAST_EXPLAINED:
        return None
    near = [(score, basis) for score, basis in scored if score >= best - NEAR]
    score, basis = min(near, key=lambda entry: entry[1].size)
    values, deviations = basis.fit(rows, max(1, round(BLOCK * found.correlation_time / rows[0].step)))
    return Law(basis.tables(values, deviations), score, basis.variables, basis.shared)


def tabled_force(table: ResidualTable, found: ResidualForce, log: int) -> Array:
    """What a table gives along a log, along each coordinate, N, shape (K, m)."""
    lengths = length_rows(found.arm)
    rows = _rows(found, log, lengths, inputs_of(found.arm))
    own, at = {}, 0
    for i, section in enumerate(found.arm.parameters.sections, start=1):
        count = len(section.resolved_bellows(i))
        own[str(Place.of_section(i))] = list(range(at, at + count))
        own |= {str(Place.of_bellows(i, k)): [at + k - 1] for k in range(1, count + 1)}
        at += count
    force = np.zeros((len(rows.force), len(lengths)))
    for bellows in table.tables:
        for j in own[bellows.where]:
            for curve in bellows.curves:
                force[:, j] += curve.value(rows.known[curve.variable][:, j])
    return np.asarray(force @ lengths)


def inputs_of(arm: Arm) -> NDArray[np.intp]:
    """The input of each bellows, shape (bellows,)."""
    names = [
        bellows.input
        for i, section in enumerate(arm.parameters.sections, start=1)
        for bellows in section.resolved_bellows(i)
    ]
    return np.array([arm.inputs.index(name) for name in names], dtype=np.intp)


def _rows(found: ResidualForce, log: int, lengths: Array, inputs: NDArray[np.intp]) -> _Rows:
    q, qd, p = (found.of_log(table, log) for table in (found.lengths, found.rates, found.pressures))
    known = {"q": q @ lengths.T, "qd": qd @ lengths.T, "p": p[:, inputs]}
    return _Rows(found.of_log(found.force, log), known, float(np.median(np.diff(found.of_log(found.time, log)))))


def _parts(rows: Sequence[_Rows]) -> list[_Rows]:
    """What is left out in turn: logs, or parts of the only one."""
    if len(rows) > 1:
        return list(rows)
    only = rows[0]
    edges = np.linspace(0, len(only.force), PARTS + 1).round().astype(int)
    return [
        _Rows(only.force[a:b], {name: table[a:b] for name, table in only.known.items()}, only.step)
        for a, b in pairwise(edges)
    ]


class _Basis:
    """Hat functions over the variables of groups of bellows: the curves' values at their nodes are what is fitted."""

    def __init__(
        self,
        found: ResidualForce,
        lengths: Array,
        rows: Sequence[_Rows],
        variables: tuple[Variable, ...],
        *,
        shared: bool,
    ) -> None:
        self.variables, self.shared, self._lengths = variables, shared, lengths
        self._groups: list[tuple[str, list[int]]] = []
        at = 0
        for i, section in enumerate(found.arm.parameters.sections, start=1):
            own = list(range(at, at + len(section.resolved_bellows(i))))
            at += len(own)
            if shared:
                self._groups.append((str(Place.of_section(i)), own))
            else:
                self._groups += [(str(Place.of_bellows(i, k)), [j]) for k, j in enumerate(own, start=1)]
        self._nodes = [
            [_nodes(np.concatenate([r.known[name][:, own].ravel() for r in rows]), name) for name in variables]
            for _, own in self._groups
        ]
        self.size = sum(len(nodes) for group in self._nodes for nodes in group)

    def _table(self, rows: _Rows) -> Array:
        """Forces along the coordinates by values at nodes, shape (K, m, size)."""
        columns = []
        for (_, own), curves in zip(self._groups, self._nodes, strict=True):
            for name, nodes in zip(self.variables, curves, strict=True):
                values = rows.known[name][:, own]
                for hat in np.eye(len(nodes)):
                    columns.append(np.interp(values, nodes, hat) @ self._lengths[own])
        return np.stack(columns, axis=-1)

    def force(self, rows: _Rows, values: Array) -> Array:
        """Forces along the coordinates, N, shape (K, m)."""
        return np.asarray(self._table(rows) @ values)

    def fit(self, parts: Sequence[_Rows], block: int = 0) -> tuple[Array, Array]:
        """Values at the nodes, N, and their standard deviations from blocks of rows; zeros without blocks."""
        tables = [self._table(part) for part in parts]
        normal = sum(np.einsum("kmi,kmj->ij", t, t) for t in tables) + np.zeros((self.size, self.size))
        right = sum(np.einsum("kmi,km->i", t, part.force) for t, part in zip(tables, parts, strict=True))
        scale = SMOOTHNESS * np.trace(normal) / self.size
        normal = normal + scale * (self._bends() + np.eye(self.size))
        inverse = np.linalg.inv(normal)
        values = inverse @ right
        if not block:
            return values, np.zeros(self.size)
        scores = [
            np.einsum("kmi,km->i", t[k : k + block], (part.force - t @ values)[k : k + block])
            for t, part in zip(tables, parts, strict=True)
            for k in range(0, len(t), block)
        ]
        meat = np.array(scores).T @ np.array(scores) * len(scores) / max(1, len(scores) - 1)
        return values, np.sqrt(np.maximum(np.diag(inverse @ meat @ inverse), 0.0))

    def _bends(self) -> Array:
        """Squares of the curves' bends."""
        penalty, at = np.zeros((self.size, self.size)), 0
        for nodes in chain.from_iterable(self._nodes):
            own = slice(at, at + len(nodes))
            bends = np.diff(np.eye(len(nodes)), n=2, axis=0)
            penalty[own, own] += bends.T @ bends
            at += len(nodes)
        return penalty

    def tables(self, values: Array, deviations: Array) -> list[Bellows]:
        """The curves as a table's."""
        made, at = [], 0
        for (where, _), curves in zip(self._groups, self._nodes, strict=True):
            own = []
            for name, nodes in zip(self.variables, curves, strict=True):
                part = slice(at, at + len(nodes))
                own.append(
                    Curve(
                        variable=name,
                        nodes=nodes.tolist(),
                        force=values[part].tolist(),
                        deviation=deviations[part].tolist(),
                    )
                )
                at += len(nodes)
            made.append(Bellows(where=where, curves=own))
        return made


def _nodes(values: Array, name: str) -> Array:
    """Nodes over what a variable does; of a rate with one at zero, where a force may change its sign."""
    low, high = (float(v) for v in np.quantile(values, KNOWN))
    if name == "qd" and low < 0.0 < high:
        below, above = (end * (1.0 - np.array(RATE_NODES)) for end in (low, high))
        return np.concatenate([below, above[-2::-1]])
    width = max(high - low, 1e-9 * max(abs(low), abs(high), 1e-9))
    return np.asarray(low + width * np.array(NODES))
