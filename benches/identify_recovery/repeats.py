"""Repeats of an identification, one line of a file each, so that a run can go on where another ended."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from bha.errors import BhaError, LogWarning
from bha.identification import Settings, default_free, identify
from bha.parameters import paths

from .logs import Condition, arm_of, start_of, synthetic_log


def repeat(condition: Condition, seed: int, *, sections: int = 1, logs: int = 1, draws: int | None = None) -> Any:
    """One identification of an arm that is known, as plain values.

    Args:
        condition: how its logs are made.
        seed: of pressures, noise and start.
        sections: of the arm.
        logs: how many of them.
        draws: redrawn pressure noises; the default's if None, 0 leaves pressure noise in the estimates.
    """
    arm = arm_of(sections)
    free = default_free(arm.parameters)
    made = [synthetic_log(arm, condition, 1000 * seed + k) for k in range(logs)]
    settings = Settings(threads=1) if draws is None else Settings(threads=1, draws=draws)
    line: dict[str, Any] = {"condition": condition.name, "seed": seed}
    began = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LogWarning)
            result = identify(start_of(arm, free, seed), made, free, settings=settings)
    except BhaError as error:
        return line | {"failed": str(error), "seconds": time.process_time() - began}
    line |= {"seconds": time.process_time() - began, "converged": result.converged, "parameters": {}}
    for estimate in result.estimates:
        true = paths.get_value(arm.parameters, estimate.path)
        line["parameters"][estimate.path] = {
            "true": true,
            "value": estimate.value,
            "error": estimate.standard_error,
            "inside": bool(estimate.interval[0] <= true <= estimate.interval[1]),
        }
    noises = result.refinement.noises
    if noises is not None:
        line["noise"] = noises.found.sizes.summary()
    line["left"] = float(np.sqrt(np.mean([r.rms**2 for r in result.residuals])))
    return line


def read(store: Path) -> list[Any]:
    """The lines of a store; none if there is no such file. A line that was cut off does not count."""
    lines = []
    for text in store.read_text().splitlines() if store.exists() else ():
        try:
            lines.append(json.loads(text))
        except json.JSONDecodeError:
            continue
    return lines


def run(store: Path, conditions: Iterable[Condition], seeds: range, **options: Any) -> None:
    """Repeats that the store does not have yet, seed by seed over all conditions, each written at once."""
    have = {(line["condition"], line["seed"]) for line in read(store)}
    chosen = list(conditions)
    store.parent.mkdir(parents=True, exist_ok=True)
    cut = store.exists() and not store.read_text().endswith("\n")
    with store.open("a") as file:
        if cut:
            file.write("\n")
        for seed in seeds:
            for condition in chosen:
                if (condition.name, seed) not in have:
                    file.write(json.dumps(repeat(condition, seed, **options)) + "\n")
                    file.flush()
