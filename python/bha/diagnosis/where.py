"""Where a model's error sits: by channel, section and mode, time, frequency, region of q, q' and p, direction, motion.

What: error over noise in every group, each with a p-value against the noise that respects correlation: the residual is
white under a right model (:mod:`bha.estimation.bands`), so the mean square of blocks of white numbers is tested, and
groups are compared with the rest by a permutation of whole blocks.
Convention: residual is measured less simulated; a *mode* is u, v (bends) or l (mean length) of a section, in m at the
bellows' radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.fft import dct

from bha.diagnosis.fit import Problem
from bha.diagnosis.result import plain
from bha.estimation.bands import NoiseModel, frequencies
from bha.parameters import Place
from bha.recordings import Observation

Array = NDArray[np.float64]

#: Length of a block, s: a swing of the arm or more.
BLOCK_TIME = 1.0
#: Bands of the report, Hz.
BANDS = ((0.0, 0.2), (0.2, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 30.0))
#: Number of quantile bins of a region.
BINS = 6
PERMUTATIONS = 400


def block_edges(time: Array, block: float = BLOCK_TIME) -> list[slice]:
    """Slices of about ``block`` s."""
    span = float(time[-1] - time[0])
    count = max(1, round(span / block))
    edges = np.linspace(0, len(time), count + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges) if b > a]


def locate(
    problem: Problem, noise: NoiseModel, outputs: Sequence[Array], white: Array, seed: int, radius: Sequence[float]
) -> dict[str, Any]:
    """Where the error sits, as plain data for the report.

    Args:
        problem: the logs.
        noise: their noise model.
        outputs: simulated outputs of each log.
        white: white residual of all logs.
        seed: of the permutations.
        radius: bellows radius of each section, m.
    """
    records = problem.records
    channels = records[0].channels
    residuals = [r.measured - y for r, y in zip(records, outputs, strict=True)]
    floor = noise.floor
    blocks = [part for w, k in _white_parts(problem, white) for part in (k[s] for s in block_edges(w))]
    rng = np.random.default_rng([seed, 5])
    error = np.sqrt(np.mean(np.concatenate([r**2 for r in residuals]), axis=0))
    whole = float(white @ white) / len(white)
    degrees = len(white)
    result: dict[str, Any] = {
        "overall": {
            "rms": float(np.sqrt(np.mean(error**2))),
            "noise": float(np.sqrt(np.mean(floor**2))),
            "white_mean_square": whole,
            "p_value": float(stats.chi2.sf(whole * degrees, degrees)),
        },
        "channel": [
            {"name": c, "rms": e, "noise": f, "ratio": e / max(f, 1e-12), "p_value": _block_p(blocks, k)}
            for k, (c, e, f) in enumerate(zip(channels, error, floor, strict=True))
        ],
        "section": _sections(records[0].observation, error, floor),
        "mode": _modes(records, residuals, floor, radius),
        "time": _times(records, residuals, floor),
        "band": _bands(records, residuals, noise),
        "region": _regions(problem, residuals, floor, rng),
    }
    found = plain(result)
    assert isinstance(found, dict)
    return found


def _white_parts(problem: Problem, white: Array) -> list[tuple[Array, Array]]:
    return [
        (w.time, white[part].reshape(w.kept, -1)) for part, w in zip(problem.slices(), problem.whiteners, strict=True)
    ]


def _block_p(blocks: Sequence[Array], channel: int) -> float:
    """p-value of the mean square of one white channel being above one, by the spread between blocks."""
    means = np.array([np.mean(b[:, channel] ** 2) for b in blocks])
    if len(means) < 3:
        return 1.0
    # At least the spread that white noise has.
    size = float(np.mean([len(b) for b in blocks]))
    spread = max(float(np.std(means, ddof=1)), np.sqrt(2.0 / size))
    return float(stats.norm.sf((np.mean(means) - 1.0) / (spread / np.sqrt(len(means)))))


def _sections(observation: Observation, error: Array, floor: Array) -> list[dict[str, Any]]:
    result = []
    sections = [output.section for output in observation.outputs]
    for number in sorted(set(sections)):
        index = [k for k, own in enumerate(sections) if own == number]
        rms, noise = float(np.sqrt(np.mean(error[index] ** 2))), float(np.sqrt(np.mean(floor[index] ** 2)))
        result.append(
            {"name": str(Place.of_section(number)), "rms": rms, "noise": noise, "ratio": rms / max(noise, 1e-12)}
        )
    return result


def _modes(
    records: Sequence[Any], residuals: Sequence[Array], floor: Array, radius: Sequence[float]
) -> list[dict[str, Any]]:
    """Bends and mean length of each section, where its coordinates are measured: amplitudes in m at the bellows."""
    rows = records[0].observation.rows
    result = []
    for number in range(1, len(radius) + 1):
        own = np.eye(rows.shape[1])[3 * number - 3 : 3 * number]
        index = [int(np.flatnonzero(same)[0]) for row in own if np.any(same := np.all(rows == row, axis=1))]
        if len(index) != 3:
            continue
        # r u, r v, l from the lengths (model page, the linear map).
        maps = {"u": (-2 / 3, 1 / 3, 1 / 3), "v": (0.0, -1 / np.sqrt(3), 1 / np.sqrt(3)), "l": (1 / 3, 1 / 3, 1 / 3)}
        for name, weights in maps.items():
            values = np.concatenate([r[:, index] @ np.array(weights) for r in residuals])
            noise = float(np.sqrt(np.sum((np.array(weights) * floor[index]) ** 2)))
            rms = float(np.sqrt(np.mean(values**2)))
            result.append({"name": f"{name}{number}", "rms": rms, "noise": noise, "ratio": rms / max(noise, 1e-12)})
    return result


def _times(records: Sequence[Any], residuals: Sequence[Array], floor: Array) -> list[dict[str, Any]]:
    result = []
    for record, residual in zip(records, residuals, strict=True):
        slices = block_edges(record.time)
        ratio = [float(np.sqrt(np.mean((residual[s] / floor) ** 2))) for s in slices]
        centre = [float(np.mean(record.time[s])) for s in slices]
        result.append({"log": record.name, "time": centre, "ratio": ratio})
    return result


def _bands(records: Sequence[Any], residuals: Sequence[Array], noise: NoiseModel) -> list[dict[str, Any]]:
    top = min(0.5 / r.sample_time for r in records)
    result = []
    for low, high in BANDS:
        if low >= top:
            continue
        power, expected, count = 0.0, 0.0, 0
        for record, residual in zip(records, residuals, strict=True):
            frequency = frequencies(len(residual), record.sample_time)
            inside = (frequency >= low) & (frequency < high)
            band = np.searchsorted(noise.edges, frequency[inside], side="right")
            power += float(np.sum(dct(residual, axis=0, norm="ortho")[inside] ** 2))
            expected += float(np.sum(np.einsum("bii->b", noise.covariance)[band]))
            count += int(np.count_nonzero(inside)) * residual.shape[1]
        if count:
            ratio = power / max(expected, 1e-30)
            result.append(
                {
                    "low": low,
                    "high": min(high, top),
                    "ratio": float(np.sqrt(ratio)),
                    "p_value": float(stats.chi2.sf(ratio * count, count)),
                }
            )
    return result


def _regions(
    problem: Problem, residuals: Sequence[Array], floor: Array, rng: np.random.Generator
) -> list[dict[str, Any]]:
    """Error by region of each length, speed and pressure, by direction of motion, and at rest against in motion."""
    records = problem.records
    ratio = np.concatenate([np.mean((r / floor) ** 2, axis=1) for r in residuals])
    labels = _block_labels(records)
    result: list[dict[str, Any]] = []
    observation = records[0].observation
    outputs = np.concatenate([r.measured for r in records])
    speeds = np.concatenate([_speed(r.time, r.measured) for r in records])
    pressures = np.concatenate([r.drive.pressures[r.rows] for r in records])
    lengths = np.flatnonzero(observation.is_length)
    for k, name in enumerate(observation.names):
        result.append(_region(name, "m", outputs[:, k], ratio, labels, rng))
        if k in lengths:
            result.append(_region("d" + name + "/dt", "m/s", speeds[:, k], ratio, labels, rng))
    for k in range(pressures.shape[1]):
        result.append(_region(problem.records[0].pressure_facts[k].name, "Pa", pressures[:, k], ratio, labels, rng))
    moving = np.sqrt(np.mean(speeds**2, axis=1))
    result.append(_region("speed of the arm", "m/s", moving, ratio, labels, rng))
    if len(lengths):
        mean = np.mean(speeds[:, lengths], axis=1)
        result.append(_region("direction of motion (lengthening > 0)", "m/s", np.sign(mean), ratio, labels, rng))
    return sorted(result, key=lambda r: r["p_value"] if r["p_value"] is not None else 1.0)


def _block_labels(records: Sequence[Any]) -> NDArray[np.intp]:
    parts, at = [], 0
    for record in records:
        label = np.empty(len(record.rows), dtype=np.intp)
        for s in block_edges(record.time):
            label[s] = at
            at += 1
        parts.append(label)
    return np.concatenate(parts)


def _speed(time: Array, outputs: Array) -> Array:
    """Rates of the outputs, smoothed over 50 ms; only to sort rows by."""
    width = max(3, round(0.05 / float(np.median(np.diff(time)))))
    kernel = np.ones(width) / width
    smooth = np.apply_along_axis(lambda y: np.convolve(np.pad(y, width // 2, mode="edge"), kernel, "same"), 0, outputs)
    start = width // 2
    return np.asarray(np.gradient(smooth[start : start + len(time)], time, axis=0))


def _region(
    name: str, unit: str, values: Array, ratio: Array, labels: NDArray[np.intp], rng: np.random.Generator
) -> dict[str, Any]:
    """Error over noise in quantile bins of ``values``, and how unlikely its spread over the bins is by chance."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
    if len(edges) < 3 and len(np.unique(values)) > 1:
        edges = np.unique(
            np.concatenate([np.unique(values)[:-1] + np.diff(np.unique(values)) / 2, [values.min(), values.max()]])
        )
    if len(edges) < 3:
        return {"name": name, "unit": unit, "edges": edges, "ratio": [float(np.sqrt(np.mean(ratio)))], "p_value": None}
    bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = int(labels.max()) + 1
    # Sums per block and bin: a permutation of whole blocks keeps what is correlated together.
    sums = np.zeros((count, len(edges) - 1))
    sizes = np.zeros_like(sums)
    np.add.at(sums, (labels, bins), ratio)
    np.add.at(sizes, (labels, bins), 1.0)
    means = sums.sum(axis=0) / np.maximum(sizes.sum(axis=0), 1.0)
    block_mean = sums.sum(axis=1) / np.maximum(sizes.sum(axis=1), 1.0)

    def spread(of_blocks: Array) -> float:
        binned = (of_blocks[:, None] * sizes).sum(axis=0) / np.maximum(sizes.sum(axis=0), 1.0)
        return float(np.std(binned))

    observed = float(np.std(means))
    draws = [spread(block_mean[rng.permutation(count)]) for _ in range(PERMUTATIONS)]
    # Within blocks the error follows the bins too; the permutation of block means is a lower bound of the chance
    # spread.
    p_value = (1.0 + float(np.sum(np.array(draws) >= observed))) / (PERMUTATIONS + 1.0)
    return {"name": name, "unit": unit, "edges": edges, "ratio": np.sqrt(means), "p_value": p_value}
