"""Which form of lag the real arm's valves have, and which of it its heads can tell.

`python -m benches.valve_forms --data FOLDER`. Three January logs of the two-section arm: commands through a form of
lag, against the measured pressures of either section, and against the first head, which is a polynomial of the lagged
command there: straight, or curved (second power). What is left is RMS over the range of each channel. Last, the lag of
the head behind the measured pressures.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

import bha

Array = NDArray[np.float64]
Form = Callable[[Array, float, Array], Array]
#: Logs, with the tubes that they drive: of the first section (fed by p21 to p23, as `bha check` finds) and the second.
LOGS = {"jan10_right_1": ("21", "11"), "jan10_3_1": ("22", "12"), "jan10_both_1": ("21", "11")}
#: Distance of the rows, s; least range of a coordinate that counts, m.
STEP, MOVES = 0.02, 8e-3


def rows(path: Path) -> Mapping[str, Array]:
    """Channels of a log on even rows; commands held, readings in straight lines."""
    log = bha.Log.read(path)
    time = np.arange(log.time[0], log.time[-1], STEP)
    held = np.clip(np.searchsorted(log.time, time, side="right") - 1, 0, None)
    found = {}
    for name in ("x1", "y1", "z1", *(f"{sort}{k}" for pair in LOGS.values() for k in pair for sort in ("p", "pc"))):
        values = log[name]
        good = np.isfinite(values)
        found[name] = values[held] if name.startswith("pc") else np.interp(time, log.time[good], values[good])
    return found


def lagged(command: Array, start: float, fill: float, vent: float) -> Array:
    """A first-order lag with two times, s."""
    keep, now, found = (np.exp(-STEP / fill), np.exp(-STEP / vent)), start, np.empty_like(command)
    for k, wanted in enumerate(command):
        found[k] = now
        now = wanted + (now - wanted) * keep[int(wanted < now)]
    return found


def late(command: Array, time: float) -> Array:
    """The same later by ``time``, s."""
    places = np.arange(len(command))
    return np.interp(places - time / STEP, places, command)


def alike(stages: int) -> Form:
    """So many lags alike in a row."""

    def form(command: Array, start: float, times: Array) -> Array:
        for _ in range(stages):
            command = lagged(command, start, times[0], times[1])
        return command

    return form


#: Forms with where their numbers begin, s.
FORMS: dict[str, tuple[Form, tuple[float, ...]]] = {
    "a lag (fill, vent)": (alike(1), (0.5, 1.4)),
    "and a dead time": (lambda u, p, q: lagged(late(u, q[2]), p, q[0], q[1]), (0.4, 1.3, 0.1)),
    "and a stage (one time)": (
        lambda u, p, q: lagged(lagged(late(u, q[2]), p, q[0], q[1]), p, q[3], q[3]),
        (0.2, 1.0, 0.05, 0.3),
    ),
    "two alike": (alike(2), (0.25, 0.7)),
    "three alike": (alike(3), (0.2, 0.5)),
}


def fitted(
    form: Form, begin: tuple[float, ...], pairs: list[tuple[Array, float, Array]], power: int
) -> tuple[Array, float]:
    """Times, s, and what is left, in ranges, where each channel is a polynomial of the lagged one."""

    def left(logarithms: Array) -> Array:
        errors = []
        for command, start, wanted in pairs:
            shown = form(command, start, np.exp(logarithms))
            table = np.vander(shown / 1e5, power + 1)
            errors.append((table @ np.linalg.lstsq(table, wanted)[0] - wanted) / np.ptp(wanted))
        return np.concatenate(errors)

    found = least_squares(left, np.log(begin), bounds=(-6.0, 4.0), diff_step=1e-3, max_nfev=40)
    return np.exp(found.x), float(np.sqrt(np.mean(found.fun**2)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the logs")
    folder = parser.parse_args().data
    logs = {name: rows(folder / f"{name}.csv") for name in LOGS}
    seen: dict[str, tuple[list[tuple[Array, float, Array]], int]] = {}
    for section in (0, 1):
        seen[f"p{section + 1}"] = (
            [
                (log[f"pc{k[section]}"], log[f"p{k[section]}"][0], log[f"p{k[section]}"])
                for k, log in zip(LOGS.values(), logs.values(), strict=True)
            ],
            1,
        )
    for power, name in ((1, "head"), (2, "head, curved")):
        for source, said in (("pc", name), ("p", f"{name}, behind measured")):
            seen[said] = (
                [
                    (log[f"{source}{k[0]}"], log[f"p{k[0]}"][0], log[axis])
                    for k, log in zip(LOGS.values(), logs.values(), strict=True)
                    for axis in ("x1", "y1", "z1")
                    if np.ptp(log[axis]) > MOVES
                ],
                power,
            )
    for said, (pairs, power) in seen.items():
        for name, (form, begin) in FORMS.items():
            times, error = fitted(form, begin, pairs, power)
            print(f"{said:28} {name:24} {error:.4f}  {', '.join(f'{t:.2f}' for t in times)} s", flush=True)


if __name__ == "__main__":
    main()
