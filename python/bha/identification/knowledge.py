"""How well parameters would be known from a log that is not measured yet, from the Fisher information of its model.

The information of several logs adds up; that of logs that were fitted comes from their result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.conditions import changes_of
from bha.estimation.engine import Model
from bha.estimation.free import Coordinate
from bha.estimation.integration import choose_integration
from bha.estimation.problem import Point, Problem, Residuals
from bha.estimation.records import Record, windows
from bha.logs import Log
from bha.names import column
from bha.recordings import ChannelFacts, Observation
from bha.recordings.outputs import coordinate_outputs, observe
from bha.runs.input import Input

Array = NDArray[np.float64]

#: Rows of a log that is not measured yet are thinned to this distance, s; their noise is that of the mean.
_INTERVAL = 0.01
#: Directions with less information than this part of the most have none.
_NOTHING = 1e-12


@dataclass(frozen=True)
class Known:
    """What fitted logs tell.

    Attributes:
        paths: of the parameters.
        information: on their values, SI units, without priors, shape (p, p).
        noise: of the channels that were measured, by name.
    """

    paths: tuple[str, ...]
    information: Array
    noise: Mapping[str, float]

    @classmethod
    def from_mapping(cls, result: Mapping[str, Any], origin: str = "result") -> Known:
        """Out of the summary of an identification, as ``bha identify --json`` prints it.

        Of a number that was estimated session by session the first session counts.

        Raises:
            InputError: it is none, or one without standard errors.
        """
        try:
            paths = [entry["path"] for entry in result["parameters"]]
            stated = result["information"]
            table = np.empty((0, 0)) if stated is None else np.array(stated, dtype=np.float64)
            residuals = result["residuals"]
            noise = {r["channel"]: float(r["noise"]) for r in residuals}
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{origin}: not a result of bha identify --json: {error!r}") from error
        if table.shape != (len(paths), len(paths)):
            raise InputError(
                f"{origin}: it has no standard errors (the fit was interrupted, or they could not be computed); "
                "identify again first"
            )
        kept = [k for k, path in enumerate(paths) if path not in paths[:k]]
        return cls(tuple(paths[k] for k in kept), _marginal(table, kept), noise)

    def on(self, coordinates: Sequence[Coordinate]) -> Array:
        """The information on the coordinates of these parameters, shape (p, p)."""
        slopes = np.array([c.slope(0.0) for c in coordinates])
        return np.asarray(self.information * np.outer(slopes, slopes))


def observation_of(arm: Arm, noise: Mapping[str, float] | None, default: float) -> tuple[Observation, Array]:
    """What would be measured, and its noise: channels by name, or all lengths with a noise of ``default``, m.

    Raises:
        LogError: a channel that the arm does not have.
    """
    if noise is None:
        observation = Observation.of(arm.parameters, coordinate_outputs(arm))
        return observation, np.full(len(observation.outputs), default)
    # Orientations are left out: a log of them alone has positions beside them, and these tell the same.
    metres = {column(name, "m"): np.zeros(2) for name in noise if not name.startswith("o")}
    log = Log.from_arrays({column("t", "s"): np.array([0.0, 1.0]), **metres})
    observation, _, _ = observe(arm, log, "the last result")
    if not observation.outputs:
        raise InputError(f"the last result has no channel of {arm.name}: {', '.join(noise)}")
    return observation, np.array([noise[output.name] for output in observation.outputs])


def made_record(
    arm: Arm,
    time: Array,
    pressures: Array,
    observed: tuple[Observation, Array],
    changes: Mapping[str, float] | None = None,
) -> Record:
    """A record of a log that is not measured yet."""
    observation, noise = observed
    rows = np.arange(0, len(time), max(1, round(_INTERVAL * (len(time) - 1) / (time[-1] - time[0]))))
    thinning = len(time) / len(rows)
    shape = (len(rows), len(observation.outputs))
    pairs = zip(observation.names, noise / np.sqrt(thinning), strict=True)
    return Record(
        name="<excitation>",
        drive=Input(time, pressures),
        rows=rows,
        observation=observation,
        measured=np.zeros(shape),
        usable=np.ones(shape, dtype=np.bool_),
        facts=tuple(ChannelFacts(name, "m", float(own), 0.0, 0.0) for name, own in pairs),
        pressure_facts=tuple(ChannelFacts(name, "Pa", 0.0, 0.0, 0.0) for name in arm.inputs),
        changes=changes_of(changes or {}),
    )


def information(arm: Arm, coordinates: tuple[Coordinate, ...], rec: Record) -> Array:
    """Fisher information of a record on coordinates, its initial state unknown, shape (p, p).

    Raises:
        ConvergenceError: the arm holds no pose at the record's first pressures, or its simulation fails.
    """
    whole = windows([rec], None)
    model = Model(arm.parameters, coordinates, (rec,))
    zero = np.zeros(len(coordinates))
    start = model.arm(zero, rec.condition).static_lengths(rec.drive.pressures[0])
    states = np.concatenate([start, np.zeros_like(start)])[None]
    model = choose_integration(model, zero, whole, states)
    flat = (zero, np.full(len(coordinates), 1e6))
    problem = Problem(model, tuple(whole), Residuals((rec.noise,), np.inf), states, flat)
    found, _ = problem.normal(Point(zero, states)).reduced()
    return np.asarray(0.5 * (found + found.T))


def deviations(table: Array) -> Array:
    """Standard deviation of each coordinate under an information, shape (p,); very large where there is none."""
    values, vectors = np.linalg.eigh(0.5 * (table + table.T))
    return np.asarray(np.sqrt(np.sum(vectors**2 / np.maximum(values, _NOTHING * values[-1]), axis=1)))


def _marginal(table: Array, kept: list[int]) -> Array:
    """The information on some parameters when nothing else is known of the others."""
    others = [k for k in range(len(table)) if k not in kept]
    if not others:
        return table
    inner = np.linalg.pinv(table[np.ix_(others, others)])
    mixed = table[np.ix_(kept, others)]
    return np.asarray(table[np.ix_(kept, kept)] - mixed @ inner @ mixed.T)
