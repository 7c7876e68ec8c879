"""What each run draws: a pure function of the seed and the run's number, whoever computes it and in which order.

Philox 4x64 (Salmon et al., Parallel random numbers: as easy as 1, 2, 3, SC 2011) is a cipher of a counter. Run k takes
the words from the counter k 2^192 on; word i, as a number between 0 and 1, goes through the inverse of the distribution
function of variable i. The key comes from the seed by NumPy's SeedSequence. Variables added at the end leave the draws
of the others as they are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from bha.sweeps.variable import Variable

Array = NDArray[np.float64]

_STANDARD_NORMAL = NormalDist()
#: Least probability of the range that a normal distribution is cut to; below it the inverse loses its digits.
_LEAST_SHARE = 1e-9

_LARGEST_EXPONENT = 709.0

#: Keys that each distribution needs, and those that it may have beside them.
_DISTRIBUTIONS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "uniform": (("low", "high"), ()),
    "log_uniform": (("low", "high"), ()),
    "normal": (("mean", "standard_deviation"), ("low", "high")),
    "log_normal": (("median", "log_standard_deviation"), ("low", "high")),
    "choice": (("values",), ("weights",)),
}
#: The key that makes draws of a distribution as large or small as they are, and what they stay above.
_SPREAD = {
    "uniform": ("high", -math.inf),
    "log_uniform": ("high", 0.0),
    "normal": ("standard_deviation", -math.inf),
    "log_normal": ("log_standard_deviation", 0.0),
}
_KEYS = (
    "low",
    "high",
    "mean",
    "standard_deviation",
    "median",
    "log_standard_deviation",
    "values",
    "weights",
    "count",
    "spacing",
)


def check_variable(variable: Variable, kind: str) -> tuple[str, str] | None:
    """The key that is wrong in a ``[[vary]]`` table and what is wrong with it; None if nothing is."""
    stated = [name for name in _KEYS if getattr(variable, name) is not None]
    if kind == "grid":
        if variable.distribution is not None:
            return "distribution", "a grid draws nothing; give values, or low, high and count"
        needed, optional, named = _grid_keys(variable, stated)
    elif variable.distribution is None:
        return "distribution", "missing; allowed: " + ", ".join(f'"{name}"' for name in _DISTRIBUTIONS)
    elif variable.is_text and variable.distribution != "choice":
        return "distribution", f'found "{variable.distribution}"; allowed for input.log: "choice"'
    else:
        needed, optional = _DISTRIBUTIONS[variable.distribution]
        named = f'distribution "{variable.distribution}"'
    if variable.is_text:
        needed = tuple(name for name in needed if name != "values")  # all logs
        optional = (*optional, "values")
    for name in needed:
        if name not in stated:
            return name, f"missing; needed with {named}"
    for name in stated:
        if name not in (*needed, *optional):
            return name, f"does not belong to {named}; remove it"
    return next(_number_faults(variable), None)


def _grid_keys(variable: Variable, stated: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    if variable.is_text or "values" in stated:
        return ("values",), (), "values in a grid"
    return ("low", "high", "count"), ("spacing",), "a range in a grid"


def _number_faults(variable: Variable) -> Iterator[tuple[str, str]]:
    low, high = variable.low, variable.high
    logarithm = "allowed: a number > 0, for its logarithm is taken"
    if low is not None and high is not None and not low < high:
        yield "low", f"found {low} and high = {high}; allowed: low below high"
    if low is not None and low <= 0 and ("log" in str(variable.distribution) or variable.spacing == "log"):
        yield "low", f"found {low}; {logarithm}"
    if high is not None and high <= 0 and variable.distribution == "log_normal":
        yield "high", f"found {high}; {logarithm}"
    values = variable.values or ()
    texts = [value for value in values if isinstance(value, str)]
    if len(texts) != (len(values) if variable.is_text else 0):
        yield "values", f"found {list(values)}; allowed: " + ("names of logs" if variable.is_text else "numbers")
    if len(set(values)) < len(values):
        yield "values", f"found {list(values)}; allowed: each value once"
    if variable.weights is not None:
        if variable.values is None:
            yield "values", "missing; needed with weights"
        if len(variable.weights) != len(values) or sum(variable.weights) <= 0:
            yield "weights", f"found {list(variable.weights)}; allowed: {len(values)} numbers >= 0, not all zero"
        if not math.isfinite(sum(variable.weights)):
            yield "weights", f"found {list(variable.weights)}; allowed: numbers whose sum is finite"
    if variable.distribution in ("normal", "log_normal"):
        below, above, _ = _cut(variable)
        if not above - below >= _LEAST_SHARE:
            share = f"low and high leave {above - below:.1e} of the distribution"
            yield "low", f"{share}; allowed: at least {_LEAST_SHARE}"
    if fault := _range_fault(variable):
        yield fault


def _range_fault(variable: Variable) -> tuple[str, str] | None:
    """The key whose number makes numbers that no computer can hold."""
    if variable.distribution in _SPREAD:
        key, least = _SPREAD[variable.distribution]
        extremes = [quantile(variable, u) for u in (2.0**-53, 1.0 - 2.0**-53)]
        if not all(least < number < math.inf for number in extremes):
            spread = f"draws from {extremes[0]:.3g} to {extremes[1]:.3g}"
            return key, f"found {getattr(variable, key)}: {spread}; allowed: what makes finite numbers"
    elif variable.low is not None and variable.high is not None and variable.count is not None:
        inside = _on_grid(variable, np.array([0, max(variable.count - 2, 0)]))
        if not np.isfinite(inside).all():
            return "high", f"found {variable.high} and low = {variable.low}; allowed: a range that is a finite number"
    return None


def levels(variable: Variable) -> int:
    """Number of values of a variable of a grid."""
    return len(variable.values) if variable.values is not None else variable.count or 0


def grid_values(variable: Variable, places: NDArray[np.integer]) -> Array:
    """The numbers of a variable of a grid at some places, from 0, of its list.

    Computed place by place: a range may have more of them than memory holds.
    """
    if variable.values is not None:
        return np.asarray([float(variable.values[place]) for place in places])
    return _on_grid(variable, places)


def _on_grid(variable: Variable, places: NDArray[np.integer]) -> Array:
    """Like ``numpy.linspace`` and ``numpy.geomspace``, whose ends are exact."""
    low, high, count = variable.low, variable.high, variable.count
    assert low is not None
    assert high is not None
    assert count is not None
    with np.errstate(over="ignore", invalid="ignore"):
        if variable.spacing == "log":
            start, stop = np.log10(low), np.log10(high)
            values = np.power(10.0, places * ((stop - start) / max(count - 1, 1)) + start)
        else:
            values = places * ((high - low) / max(count - 1, 1)) + low
    return np.where(places == 0, low, np.where(places == count - 1, high, values))


def grid_rows(sizes: Sequence[int], first: int, count: int) -> NDArray[np.int64]:
    """For ``count`` runs from ``first`` on the place of each variable in its list, shape (count, variables).

    The last variable changes fastest.
    """
    rest = np.arange(first, first + count, dtype=np.int64)
    places = np.empty((count, len(sizes)), dtype=np.int64)
    for column in reversed(range(len(sizes))):
        rest, places[:, column] = np.divmod(rest, sizes[column])
    return places


def key_of(seed: int) -> NDArray[np.uint64]:
    """The key of Philox that belongs to a seed."""
    return np.asarray(np.random.SeedSequence(seed).generate_state(2, np.uint64), dtype=np.uint64)


def uniforms(key: NDArray[np.uint64], run: int, count: int) -> Array:
    """``count`` numbers in the open interval (0, 1) that belong to one run."""
    # The low words of the counter count the blocks of a run, the highest one the runs.
    words = np.random.Philox(key=key, counter=[0, 0, 0, run]).random_raw(count)
    # 52 bits and a half: neither 0 nor 1 can come out.
    return (np.asarray(words >> np.uint64(12), dtype=np.float64) + 0.5) * 2.0**-52


def monte_carlo_rows(variables: Sequence[Variable], seed: int, first: int, count: int) -> Array:
    """What ``count`` runs from ``first`` on draw, shape (count, variables); of chosen names and values the place."""
    key = key_of(seed)
    rows = np.empty((count, len(variables)))
    for row in range(count):
        for column, u in enumerate(uniforms(key, first + row, len(variables))):
            rows[row, column] = quantile(variables[column], float(u))
    return rows


def quantile(variable: Variable, u: float) -> float:
    """The number below which a draw lies with probability ``u``, 0 < u < 1; of a choice the chosen value's place."""
    low, high = variable.low, variable.high
    match variable.distribution:
        case "uniform":
            assert low is not None
            assert high is not None
            return low + u * (high - low)
        case "log_uniform":
            assert low is not None
            assert high is not None
            ratio = high / low
            return min(max(low * math.pow(ratio, u), low), high) if ratio < math.inf else math.inf
        case "normal" | "log_normal":
            below, above, sign = _cut(variable)
            share = below + (u if sign > 0 else 1.0 - u) * (above - below)
            centre, width = _normal_of(variable)
            value = centre + sign * width * _STANDARD_NORMAL.inv_cdf(min(max(share, 2.0**-1000), 1.0 - 2.0**-53))
            if variable.distribution == "log_normal":
                value = math.exp(value) if value < _LARGEST_EXPONENT else math.inf
            value = value if low is None else max(value, low)
            return value if high is None else min(value, high)
        case "choice":
            values = variable.values or ()
            weights = variable.weights or (1.0,) * len(values)
            edges = np.cumsum(weights)
            last = int(np.searchsorted(edges, edges[-1], side="left"))  # what follows it has no weight
            return float(min(int(np.searchsorted(edges, u * edges[-1], side="right")), last))
    raise AssertionError(variable.distribution)


def _normal_of(variable: Variable) -> tuple[float, float]:
    """Mean and standard deviation of a normal distribution, or of the logarithm of a log-normal one."""
    if variable.distribution == "log_normal":
        assert variable.median is not None
        assert variable.log_standard_deviation is not None
        return math.log(variable.median), variable.log_standard_deviation
    assert variable.mean is not None
    assert variable.standard_deviation is not None
    return variable.mean, variable.standard_deviation


def _cut(variable: Variable) -> tuple[float, float, float]:
    """Probabilities between which draws lie, and 1; or, where both bounds lie above the middle, those of the mirrored
    distribution, and -1, since probabilities next to 1 have few digits.
    """
    centre, width = _normal_of(variable)

    def standard(bound: float | None, unbounded: float) -> float:
        if bound is None:
            return unbounded
        return ((math.log(bound) if variable.distribution == "log_normal" else bound) - centre) / width

    low, high = standard(variable.low, -math.inf), standard(variable.high, math.inf)
    if low > 0:
        return _STANDARD_NORMAL.cdf(-high), _STANDARD_NORMAL.cdf(-low), -1.0
    return _STANDARD_NORMAL.cdf(low), _STANDARD_NORMAL.cdf(high), 1.0
