"""Arms as a function of a few numbers, as estimation makes them by the thousand: without text, without checking anew.

What: a description of the arm for the core that follows from some values (a mass, a factor on all dampings, a tangent
stiffness at one length) is asked for at a few points; from then on the numbers in it are computed. Most follow a value
straight, or are a product of several that do (moments of inertia: mass times factor). Whether all of them do is checked
at a point where every value is another; where one does not, the description is asked for each time.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.errors import BhaError, InputError

Array = NDArray[np.float64]
#: The description of an arm for the core, at some values, shape (k,).
Describe = Callable[[Array], Mapping[str, Any]]
#: An effect in it: ``kind``, ``where`` and ``parameters``, numbers by name.
Effect = Mapping[str, Any]

#: Steps to the points asked for, in the reach of a value; the first that all descriptions exist for is taken.
_STEPS = (0.2, -0.2, 0.02, -0.02, 1e-3, -1e-3)
#: Where every value is another: shares of its step.
_SHARES = (0.9, 0.35, 0.6)
#: Greatest relative error of a computed number.
_EXACT = 1e-9
#: The same of one that is nothing but rounding.
_ROUNDED = 1e-14


@dataclass(frozen=True)
class _Compiled:
    """Numbers of a description: ``base`` and slopes by the values, added up or multiplied; m places, k values."""

    places: tuple[str, ...]
    base: Array
    slopes: Array
    products: NDArray[np.bool_]

    def __call__(self, changes: Array) -> Array:
        """The numbers, shape (m,), where the values have changed by so much, shape (k,)."""
        moved = self.slopes * changes
        numbers = self.base + moved.sum(axis=1)
        if self.products.any():
            own = self.base[self.products]
            numbers[self.products] = own * np.prod(1.0 + moved[self.products] / own[:, None], axis=1)
        # What is none but for rounding is none: less than none of a time or a mass would be no arm.
        size = np.abs(self.base) + np.abs(moved).sum(axis=1)
        return np.where(np.abs(numbers) <= _ROUNDED * size, 0.0, numbers)


class Variants:
    """The arms of a description that follows from values; more effects can be put beside what it has."""

    def __init__(self, describe: Describe, values: Sequence[float] | Array, reach: Sequence[float] | Array) -> None:
        """Ask for what has to be known.

        Args:
            describe: the description at some values.
            values: where to begin, shape (k,); an arm has them.
            reach: how far each value plausibly moves, shape (k,), positive.

        Raises:
            ParameterError: no arm has the values to begin with.
        """
        self._describe = describe
        self._start = np.array(values, dtype=np.float64)
        self._first = describe(self._start)
        arm_of(self._first)
        self._compiled = _compile(describe, self._start, np.asarray(reach, dtype=np.float64), self._first)
        self._effects: tuple[Effect, ...] = ()
        self._prepare()

    def _prepare(self) -> None:
        self._core: _core.Variants | None = None
        if self._compiled is not None:
            count = len(self._first.get("effect", ()))
            more = [
                f"/effect/{count + k}/parameters/{name}"
                for k, effect in enumerate(self._effects)
                for name in effect["parameters"]
            ]
            text = json.dumps(with_effects(self._first, self._effects), allow_nan=False)
            self._core = _core.Variants(text, (*self._compiled.places, *more))
        self._made = lru_cache(maxsize=64)(self._new)

    @property
    def computed(self) -> bool:
        """Whether the numbers are computed; else the description is asked for each time."""
        return self._compiled is not None

    def beside(self, effects: Sequence[Effect]) -> Variants:
        """The same arms with effects added, whose numbers are values of their own.

        Raises:
            ParameterError: an effect that is not allowed.
        """
        made = copy(self)
        made._effects = (*self._effects, *effects)
        made._prepare()
        return made

    def arm(self, values: Array, numbers: Sequence[Mapping[str, float]] = ()) -> _core.Arm:
        """The arm at some values, shape (k,), and numbers of the effects beside it; the same object for the same arm.

        Raises:
            ParameterError: no arm has them.
            InputError: one of them is not finite.
        """
        if self._compiled is None:
            effects = [{**effect, "parameters": own} for effect, own in zip(self._effects, numbers, strict=True)]
            return arm_of(with_effects(self._describe(np.asarray(values)), effects))
        own = [
            number[name] for effect, number in zip(self._effects, numbers, strict=True) for name in effect["parameters"]
        ]
        return self._made(np.concatenate([self._compiled(values - self._start), own]).tobytes())

    def _new(self, key: bytes) -> _core.Arm:
        assert self._core is not None
        return self._core.arm(np.frombuffer(key))


def arm_of(description: Mapping[str, Any]) -> _core.Arm:
    """The arm of a description for the core.

    Raises:
        ParameterError: there is none.
        InputError: a number that is not finite.
    """
    try:
        text = json.dumps(description, allow_nan=False)
    except ValueError as error:
        raise InputError("a number of the arm is not finite; finite numbers are needed") from error
    return _core.Arm(text)


def with_effects(description: Mapping[str, Any], effects: Sequence[Effect]) -> Mapping[str, Any]:
    """A description with effects added to those it has."""
    return {**description, "effect": [*description.get("effect", []), *effects]} if effects else description


def _compile(describe: Describe, values: Array, reach: Array, first: Mapping[str, Any]) -> _Compiled | None:
    """How the numbers follow from the values; None where they do otherwise than in straight lines and products."""
    base = dict(_numbers(first))
    steps, slopes = np.zeros(len(values)), dict[str, Array]()
    for k in range(len(values)):
        found = _along(describe, values, k, float(reach[k]))
        if found is None or not found[1].keys() == found[2].keys() == base.keys():
            return None
        steps[k], near, far = found
        for place, number in near.items():
            change, twice = number - base[place], far[place] - base[place]
            if change == 0.0 == twice:
                continue
            if abs(twice - 2.0 * change) > _EXACT * max(abs(number), abs(base[place])):
                return None
            slopes.setdefault(place, np.zeros(len(values)))[k] = change / steps[k]
    places = tuple(slopes)
    table = np.array(list(slopes.values())).reshape(len(places), len(values))
    own = np.array([base[place] for place in places])
    shared = (np.count_nonzero(table, axis=1) > 1) & (own != 0.0)
    sums = _Compiled(places, own, table, np.zeros(len(places), dtype=np.bool_))
    changes = steps * np.resize(_SHARES, len(values))
    wanted = _described(describe, values + changes)
    if wanted is None or wanted.keys() != base.keys():
        return None
    there = np.array([wanted[place] for place in places])
    # A number that several values act on is the sum of what they do, or the product.
    products = shared & ~_near(sums(changes), there)
    compiled = _Compiled(places, own, table, products)
    same = all(wanted[place] == number for place, number in base.items() if place not in slopes)
    return compiled if same and bool(np.all(_near(compiled(changes), there))) else None


def _near(numbers: Array, wanted: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(numbers - wanted) <= _EXACT * np.maximum(np.abs(numbers), np.abs(wanted)))


def _along(
    describe: Describe, values: Array, k: int, reach: float
) -> tuple[float, dict[str, float], dict[str, float]] | None:
    """A step of one value, and the numbers one step and two steps away."""
    for share in _STEPS:
        found = []
        for times in (1.0, 2.0):
            moved = values.copy()
            moved[k] += times * share * reach
            found.append(_described(describe, moved))
        if found[0] is not None and found[1] is not None:
            return share * reach, found[0], found[1]
    return None


def _described(describe: Describe, values: Array) -> dict[str, float] | None:
    """The numbers of the description at some values; None where no arm has them."""
    try:
        description = describe(values)
        arm_of(description)
    except BhaError:
        return None
    return dict(_numbers(description))


def _numbers(entry: Any, place: str = "") -> Iterator[tuple[str, float]]:
    """Numbers of a description by place, a JSON pointer."""
    if isinstance(entry, Mapping):
        for key, value in entry.items():
            yield from _numbers(value, f"{place}/{key}")
    elif isinstance(entry, list | tuple):
        for k, value in enumerate(entry):
            yield from _numbers(value, f"{place}/{k}")
    elif isinstance(entry, int | float) and not isinstance(entry, bool):
        yield place, float(entry)
