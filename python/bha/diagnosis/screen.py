"""Screening: which effect, in which place, would explain what the plain model leaves, without refitting any.

What: the signature of every candidate, the change of the outputs per unit of strength, by one simulation at small
strength; projected on the complement of what plain parameters and initial states can do; its Rao score against the
residual.
Source: Rao 1948 (score test); Davies 1987 for the shapes, numbers that do not exist without the effect: the maximum
over their grid counts.
Convention: a score is the drop of the sum of squares of the white residual that the candidate alone, linearly, would
bring.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from bha import _core, names
from bha.arm.variants import arm_of, with_effects
from bha.diagnosis.cache import Cache
from bha.diagnosis.candidate import Candidate
from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.information import information
from bha.diagnosis.memory import draws_like
from bha.diagnosis.places import members, place_of, places
from bha.diagnosis.plan import KindPlan
from bha.diagnosis.shortcuts import (
    OF_SENSORS,
    ON_LENGTHS,
    ON_PRESSURES,
    PressureProbe,
    acting_pressures,
    length_change,
)
from bha.errors import BhaError
from bha.estimation.derived import Core
from bha.estimation.runs import Run
from bha.parameters import Place

Array = NDArray[np.float64]

#: Probes that are simulated in one go.
BATCH = 96
#: Draws of the residual that say what the best of all candidates explains by chance: p-values are no finer than one in
#: as many.
CHANCE_DRAWS = 199
#: Least share of what one element of a kind leaves of the residual that a bank of them has to promise to remove.
BANK_SHARE = 0.1


@dataclass(frozen=True)
class Signatures:
    """Signatures of all candidates.

    Attributes:
        candidates: what was probed or summed up.
        columns: for each candidate the columns of ``table`` that it sums, per strength.
        table: white signatures of the probes, shape (rows, probes), single precision: some hundred of them.
    """

    candidates: tuple[Candidate, ...]
    columns: tuple[tuple[tuple[int, ...], ...], ...]
    table: NDArray[np.float32]


@dataclass(frozen=True)
class Scored:
    """A candidate with its score.

    Attributes:
        candidate: kind, place and shapes.
        score: drop of the sum of squares that it would bring.
        strengths: strengths that would bring it.
        share: score over the sum of squares that is left.
        deviation: standard deviation of the first strength under the noise alone.
    """

    candidate: Candidate
    score: float
    strengths: tuple[float, ...]
    share: float
    deviation: float


def probe(
    problem: Problem, fit: Fit, plans: Sequence[KindPlan], tell: Callable[[float], None], cache: Cache
) -> Signatures:
    """Signatures of all candidates around ``fit``."""
    core = fit.model.description(fit.x)
    probes: dict[tuple[str, str, tuple[tuple[str, float], ...], int], int] = {}
    changes: list[tuple[dict[str, Any], float]] = []
    candidates: list[Candidate] = []
    columns: list[tuple[tuple[int, ...], ...]] = []
    for plan in plans:
        for where in places(plan, core, fit.model.parameters.measures_coordinates):
            for shape in shapes_at(plan, where, fit, problem):
                per_strength = []
                for number, (numbers, size) in enumerate(plan.probed(shape)):
                    index = []
                    for part in members(where, plan.parts, core) if plan.parts else [where]:
                        key = (plan.kind, part, tuple(sorted(shape.items())), number)
                        if key not in probes:
                            probes[key] = len(changes)
                            changes.append(({"kind": plan.kind, "where": part, "parameters": numbers}, size))
                        index.append(probes[key])
                    per_strength.append(tuple(index))
                candidates.append(Candidate(plan, where, shape))
                columns.append(tuple(per_strength))
    known = cache.get("signatures", {"table": (problem.rows, len(changes))})
    if known is not None:
        return Signatures(tuple(candidates), tuple(columns), np.asarray(known["table"], dtype=np.float32))
    table = np.zeros((problem.rows, len(changes)), dtype=np.float32)
    plain, integration = fit.model.runs(fit.x, fit.states), fit.model.integration
    count = len(plain)
    # A plain model that makes up for a lag is damped more than the file's, too stiff for a long step.
    coarse = all(np.all(np.isfinite(y)) for y in integration.run(plain, coarse=True))
    for first in range(0, len(changes), BATCH):
        tell(first / len(changes))
        batch = changes[first : first + BATCH]
        run = [k for k, (effect, _) in enumerate(batch) if effect["kind"] not in ON_LENGTHS]
        probed = _runs(problem, fit, core, [batch[k][0] for k in run])
        outputs = integration.run([*plain, *probed], coarse=coarse)
        base, outputs = outputs[:count], outputs[count:]
        for k, (effect, size) in enumerate(batch):
            if k in run:
                at = run.index(k) * count
                change = [(a - b) / size for a, b in zip(outputs[at : at + count], base, strict=True)]
            else:
                sensor = place_of(str(effect["where"]))
                assert sensor.section is not None
                assert sensor.bellows is not None
                channel = names.length_name(sensor.section, sensor.bellows)
                change = [
                    length_change(str(effect["kind"]), channel, r, y, size)
                    for r, y in zip(problem.records, base, strict=True)
                ]
            # A probe that diverges has no signature: it scores nothing.
            table[:, first + k] = np.nan_to_num(problem.white(change), nan=0.0, posinf=0.0, neginf=0.0)
    cache.put("signatures", table=table)
    return Signatures(tuple(candidates), tuple(columns), table)


def _runs(problem: Problem, fit: Fit, core: Core, effects: Sequence[dict[str, Any]]) -> list[Run]:
    """Runs of the probes on every log, probe by probe; pressures that act are computed beforehand."""
    plain = fit.model.runs(fit.x, fit.states)
    place = {str(Place.of_input(name)): j for j, name in enumerate(core["inputs"])}
    pressures = [
        PressureProbe(e["kind"], tuple(place[m] for m in members(e["where"], "input", core)), e["parameters"])
        for e in effects
        if _on_pressures(e)
    ]
    acting = [iter(acting_pressures(r, pressures, float(core["ambient_pressure"]))) for r in problem.records]
    runs = []
    for effect in effects:
        if _on_pressures(effect):
            runs += [replace(run, drive=run.record.driven_by(next(p))) for run, p in zip(plain, acting, strict=True)]
        else:
            arm = _probed(core, effect)
            runs += [replace(run, arm=arm) for run in plain]
    return runs


def _on_pressures(effect: Mapping[str, Any]) -> bool:
    return effect["kind"] in ON_PRESSURES and effect["where"] not in OF_SENSORS


def _probed(core: Core, effect: dict[str, Any]) -> _core.Arm | None:
    """The arm with an effect beside what it has; None where there is none."""
    try:
        return arm_of(with_effects(core, [effect]))
    except BhaError:
        return None


def shapes_at(plan: KindPlan, where: str, fit: Fit, problem: Problem) -> list[dict[str, float]]:
    """The grid of the shapes; walls stand where the head comes: ``distance`` is a share of its reach that way."""
    grid = plan.shape_grid()
    if plan.kind != "contact":
        return grid
    section = int(where.split()[1]) - 1
    heads = head_path(fit, problem, section)
    result = []
    for shape in grid:
        reach = heads[:, 0] * np.cos(shape["angle"]) + heads[:, 1] * np.sin(shape["angle"])
        result.append({**shape, "distance": float(np.quantile(reach, shape["distance"]))})
    return result


def head_path(fit: Fit, problem: Problem, section: int) -> Array:
    """Positions of a head under the fit, every tenth row, shape (rows, 3)."""
    names_of_heads = names.position_names(section + 1)
    parts = []
    for number, (record, outputs) in enumerate(zip(problem.records, fit.outputs, strict=True)):
        arm, observation = fit.model.shown(fit.x, number)
        assert arm is not None
        if all(name in record.channels for name in names_of_heads):
            seen = outputs[::10][:, [record.channels.index(name) for name in names_of_heads]]
            parts.append(observation.camera.base_positions(seen))
        else:
            # All lengths are among the outputs where heads are not.
            table = outputs[::10][:, : len(record.observation.rows)] - record.observation.offsets
            lengths = np.linalg.lstsq(record.observation.rows, table.T, rcond=None)[0].T
            parts.append(np.array([arm.forward_kinematics(q)[0][section] for q in lengths]))
    return np.concatenate(parts)


@dataclass(frozen=True)
class Screening:
    """Result of a screening.

    Attributes:
        ranking: all candidates by score, the best first.
        gram: inner products of the projected probes, shape (probes, probes).
        inner: inner products of the projected probes with the residual.
        total: sum of squares of the projected residual: what scores are shares of.
        by_chance: share of its sum of squares that the best of all candidates explains of a residual that has the
            memory of this one and no cause among them, in ascending order, one a draw.
    """

    ranking: tuple[Scored, ...]
    gram: Array
    inner: Array
    total: float
    by_chance: Array

    def chance(self, gain: float) -> float:
        """Family-wise p-value: how often the best candidate brings ``gain`` in sum of squares, or more, by chance."""
        above = len(self.by_chance) - int(np.searchsorted(self.by_chance, gain / max(self.total, 1e-300)))
        return (1.0 + above) / (1.0 + len(self.by_chance))


def score(problem: Problem, fit: Fit, signatures: Signatures, seed: int = 0) -> Screening:
    """Score all candidates against the residual of ``fit``, which has its sensitivities.

    The same scores of draws of residuals with the memory of this one say what the best of so many brings by chance;
    ``seed`` is theirs.
    """
    complement = information(problem, fit).complement
    rng = np.random.default_rng([seed, 23])
    drawn = draws_like(problem, fit.residual, CHANCE_DRAWS, rng, means=False)
    rest = complement(np.column_stack([fit.residual, drawn]))
    totals = np.einsum("ij,ij->j", rest, rest)
    projected = np.empty_like(signatures.table)
    for first in range(0, projected.shape[1], 32):
        projected[:, first : first + 32] = complement(signatures.table[:, first : first + 32])
    gram = (projected.T @ projected).astype(np.float64)
    inner = (projected.T @ rest.astype(np.float32)).astype(np.float64)
    raw = np.einsum("ij,ij->j", signatures.table, signatures.table, dtype=np.float64)
    found = []
    by_chance = np.zeros(CHANCE_DRAWS)
    for candidate, columns in zip(signatures.candidates, signatures.columns, strict=True):
        k = len(columns)
        normal, size = np.zeros((k, k)), np.zeros(k)
        right = np.array([inner[list(parts)].sum(axis=0) for parts in columns])
        for a in range(k):
            size[a] = raw[list(columns[a])].sum()
            for b in range(k):
                normal[a, b] = gram[np.ix_(columns[a], columns[b])].sum()
        values, strengths, deviation = _best(candidate, normal, right, size)
        share = values / np.maximum(totals, 1e-300)
        np.maximum(by_chance, share[1:], out=by_chance)
        own = tuple(float(v) for v in strengths[:, 0])
        found.append(Scored(candidate, float(values[0]), own, float(share[0]), deviation))
    banks, shares = _banks(signatures, found, gram, inner, totals)
    np.maximum(by_chance, shares[1:], out=by_chance)
    ranking = tuple(sorted([*found, *banks], key=lambda s: -s.score))
    return Screening(ranking, gram, inner[:, 0], float(totals[0]), np.sort(by_chance))


def _banks(
    signatures: Signatures, single: Sequence[Scored], gram: Array, inner: Array, totals: Array
) -> tuple[list[Scored], Array]:
    """The banks that promise more than one element does, be its shape on the grid or between two places of it.

    Two neighbours of the grid are what an element between them looks like; what they do together is what the fit of its
    shape will bring.

    Args:
        signatures: what was probed.
        single: the scores of single elements.
        gram: inner products of the projected probes, shape (probes, probes).
        inner: those with the residual and its draws, shape (probes, draws).
        totals: sums of squares of these, shape (draws,).

    Returns:
        The banks; the greatest share that any bank, promising or not, explains of each draw, shape (draws,).
    """
    grids: dict[tuple[str, str], list[int]] = {}
    for index, candidate in enumerate(signatures.candidates):
        if candidate.shape in candidate.plan.bank:
            grids.setdefault(candidate.key, []).append(index)
    most: dict[tuple[str, str], float] = {}
    for scored in single:
        most[scored.candidate.key] = max(scored.score, most.get(scored.candidate.key, 0.0))
    found, shares = [], np.zeros(len(totals))
    for key, indices in grids.items():
        columns = [list(signatures.columns[k][0]) for k in indices]
        normal = np.array([[gram[np.ix_(a, b)].sum() for b in columns] for a in columns])
        right = np.array([inner[parts].sum(axis=0) for parts in columns])
        pairs = [together(normal[k : k + 2, k : k + 2], right[k : k + 2, :1])[0][0] for k in range(len(indices) - 1)]
        one = max(most[key], *pairs)
        scores, strengths = together(normal, right)
        np.maximum(shares, scores / np.maximum(totals, 1e-300), out=shares)
        if scores[0] - one > BANK_SHARE * (totals[0] - one):
            # All of the grid: which elements act is told by the fit, far from where the scores are linear.
            elements = tuple(signatures.candidates[k].shape for k in indices)
            bank = Candidate(signatures.candidates[indices[0]].plan, key[1], {}, elements)
            own = tuple(float(strength) for strength in strengths[:, 0])
            found.append(Scored(bank, float(scores[0]), own, float(scores[0] / max(totals[0], 1e-300)), np.inf))
    return found, shares


def together(normal: Array, right: Array) -> tuple[Array, Array]:
    """Scores, shape (draws,), and strengths, shape (k, draws), of k elements side by side, no strength negative."""
    values, vectors = np.linalg.eigh(normal)
    root = np.sqrt(np.maximum(values, 1e-9 * max(float(values[-1]), 1e-300)))
    wanted = (vectors.T @ right) / root[:, None]
    strengths = np.array([nnls(root[:, None] * vectors.T, column)[0] for column in wanted.T]).T
    scores = 2.0 * np.einsum("kj,kj->j", right, strengths) - np.einsum("kj,kl,lj->j", strengths, normal, strengths)
    return scores, strengths


def likenesses(screening: Screening, signatures: Signatures, which: Sequence[int]) -> Array:
    """Greatest canonical correlations of the projected signatures of the candidates ``which``, shape (m, m).

    One means that the data cannot tell two candidates apart; a candidate without a signature is like none.
    """
    directions: list[Array] = []
    owner: list[int] = []
    for place, index in enumerate(which):
        columns = signatures.columns[index]
        sums = np.zeros((screening.gram.shape[0], len(columns)))
        for k, parts in enumerate(columns):
            sums[list(parts), k] = 1.0
        values, vectors = np.linalg.eigh(sums.T @ screening.gram @ sums)
        alive = (values > 1e-8 * max(float(values[-1]), 1e-300)) & (values > 0.0)
        directions.append(sums @ (vectors[:, alive] / np.sqrt(values[alive])))
        owner += [place] * int(np.count_nonzero(alive))
    basis = np.concatenate(directions, axis=1)
    cosines = basis.T @ screening.gram @ basis
    result = np.eye(len(which))
    members_of = [np.flatnonzero(np.array(owner) == place) for place in range(len(which))]
    for a, first in enumerate(members_of):
        for b, second in enumerate(members_of[:a]):
            if len(first) and len(second):
                block = cosines[np.ix_(first, second)]
                value = abs(block[0, 0]) if block.size == 1 else np.linalg.svd(block, compute_uv=False)[0]
                result[a, b] = result[b, a] = min(1.0, float(value))
    return result


def _best(candidate: Candidate, normal: Array, right: Array, size: Array) -> tuple[Array, Array, float]:
    """Scores, shape (draws,), and strengths, shape (k, draws), of one candidate for ``right``, shape (k, draws).

    Directions that the plain parameters can do count for nothing, and so do strengths that are none: a lag that fills
    before it is told. The last is the deviation of its first strength.
    """
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    alive = values > 1e-6
    if not np.any(alive) or np.all(np.diag(normal) < 1e-7 * size):
        return np.zeros(right.shape[1]), np.zeros(right.shape), np.inf
    parts = vectors[:, alive]
    strengths = (parts @ ((parts.T @ (right / scale[:, None])) / values[alive, None])) / scale[:, None]
    plan = candidate.plan
    deviation = float(1.0 / scale[0])
    if len(right) == 1 and not plan.strengths and plan.begin is None:
        # The probe is the whole effect: it counts with about its own strength.
        strengths = np.clip(right / normal[0, 0], 0.5, 2.0)
        return np.maximum(0.0, (2.0 * strengths * right - strengths**2 * normal[0, 0])[0]), strengths, deviation
    if plan.is_one_sided:
        strengths = one_sided(strengths, normal, right)
    return np.einsum("kj,kj->j", right, strengths), strengths, deviation


def one_sided(strengths: Array, normal: Array, right: Array) -> Array:
    """The best strengths none of which is negative, from the best ones of either sign, shape (k, draws), k <= 2."""
    negative = np.any(strengths < 0.0, axis=0)
    alone = np.maximum(right / np.maximum(np.diag(normal), 1e-300)[:, None], 0.0)
    # The least of a quadratic over a quarter of the plane, if it is not inside, lies on one of its sides.
    on_side = np.where(np.arange(len(right))[:, None] == np.argmax(alone * right, axis=0), alone, 0.0)
    return np.where(negative, on_side, strengths)
