"""Pressures and lengths beside the ranges of the arm's file: gauge for absolute, wrong units, excursions.

What: a log's pressures, or lengths, lie within the ranges that the file permits, or they do not. Where most do not,
    each
simple mistake of the heading (gauge or absolute, another unit) is undone in turn; those that bring nearly all values
into the range explain it.
Limits: a file with a range that permits everything doubts nothing. Pressures near zero absolute are doubted all the
    same:
no pump of a bellows arm makes such a vacuum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.finding import Explanation, Finding, Severity
from bha.checkup.mend import Mend
from bha.recordings.ranges import TOLERANCE, excursions

if TYPE_CHECKING:
    from bha.arm import Arm

Array = NDArray[np.float64]

#: Fewer values inside than the first share, and a mistake is looked for that brings more than the second one inside.
DOUBTED, BELIEVED = 0.6, 0.95
#: A log is expected to use this share of the range in some chamber.
LEAST_SPREAD = 0.1
#: A pressure below this share of ambient pressure in all of a log's chambers at once is a vacuum that no arm has.
VACUUM = 0.1
#: Mixed-up units of pressure: ratio by which values are too large, and what was read for what.
PRESSURE_UNITS = {
    1e5: "bar for Pa", 1e3: "kPa for Pa", 1e2: "hPa or mbar for Pa, or bar for kPa", 6894.757: "psi for Pa",
    6.894757: "psi for kPa", 14.50377: "bar for psi", 1e-5: "Pa for bar", 1e-3: "Pa for kPa",
    1e-2: "Pa for hPa, or kPa for bar", 1.0 / 6894.757: "Pa for psi", 1.0 / 6.894757: "kPa for psi",
    1.0 / 14.50377: "psi for bar",
}  # fmt: skip
#: The same for lengths.
LENGTH_UNITS = {
    1e3: "m for mm", 1e2: "m for cm", 1e1: "cm for mm", 39.37008: "m for inches", 25.4: "inches for mm",
    1e-3: "mm for m", 1e-2: "cm for m", 1e-1: "mm for cm", 1.0 / 39.37008: "inches for m", 1.0 / 25.4: "mm for inches",
}  # fmt: skip


def inside(values: Array, ranges: Array, tolerance: float = TOLERANCE) -> float:
    """Share of values (m, k), NaN not counted, within ranges (k, 2) and a little beyond."""
    margin = tolerance * (ranges[:, 1] - ranges[:, 0])
    known = np.isfinite(values)
    fits = (values >= ranges[:, 0] - margin) & (values <= ranges[:, 1] + margin)
    return float(np.sum(fits & known) / max(1, np.sum(known)))


def pressure_findings(
    arm: Arm, ranges: Array, name: str, columns: Sequence[str], gauge: Sequence[str], time: Array, pressures: Array
) -> list[Finding]:
    """What the pressures (m, J) of a log say of its headings.

    Args:
        arm: the arm.
        ranges: permitted pressures of each input, Pa, shape (J, 2).
        name: of the log.
        columns: names of the J columns.
        gauge: those of them that are gauge pressures in the file.
        time: s, shape (m,).
        pressures: Pa absolute, shape (m, J).
    """
    ambient = arm.parameters.ambient_pressure
    is_gauge = np.array([column in gauge for column in columns])
    share = inside(pressures, ranges)
    lowest, highest = float(np.nanmin(pressures)), float(np.nanmax(pressures))
    numbers = {"inside": share, "lowest": lowest, "highest": highest, "ambient_pressure": ambient}
    evidence = (
        f"{100 * share:.0f} % of the readings lie within pressure_range; they go from {_kilo(lowest)} to "
        f"{_kilo(highest)} kPa absolute, the file permits {_kilo(ranges[:, 0].min())} to "
        f"{_kilo(ranges[:, 1].max())} kPa"
    )
    shown = ", ".join(columns[:3]) + (", ..." if len(columns) > 3 else "")
    if share < DOUBTED:
        explanations = _heading_mistakes(pressures, ranges, ambient, is_gauge, columns, shown)
        if explanations:
            what = "pressures are not what their headings say"
            kind = "gauge" if "heading" in explanations[0].what else "unit"
            split = ("look at the arm at rest and vented: its pressures are ambient pressure, 0 as gauge pressure",)
            return [
                Finding(
                    "fault", kind, name, what, evidence, numbers, explanations, split if len(explanations) > 1 else ()
                )
            ]
    if (vacuum := _vacuum(pressures, ranges, ambient, is_gauge, columns)) is not None:
        return [Finding(vacuum[0], "gauge", name, vacuum[1], evidence, numbers, vacuum[2])]
    if (double := _never_vented(pressures, ranges, ambient, is_gauge, columns)) is not None:
        severity: Severity = "fault" if inside(pressures, ranges, 0.0) < BELIEVED else "warning"
        return [Finding(severity, "gauge", name, double[0], evidence, numbers, double[1])]
    outside = excursions(time, pressures, ranges, columns, "Pa")
    if not outside:
        return []
    repair = f"check the units of {shown}, gauge or absolute, and pressure_range of the [[section]] in the arm's file"
    severity = "fault" if share < DOUBTED else "warning"
    what = "pressures leave pressure_range"
    return [
        Finding(
            severity,
            "pressure_range",
            name,
            what,
            "; ".join(outside[:4]),
            numbers,
            (Explanation("unit, gauge or range", repair),),
        )
    ]


def _heading_mistakes(
    pressures: Array, ranges: Array, ambient: float, is_gauge: NDArray[np.bool_], columns: Sequence[str], shown: str
) -> tuple[Explanation, ...]:
    """Mistakes of the heading that bring the pressures into the ranges; the simplest first."""
    raw = pressures - np.where(is_gauge, ambient, 0.0)  # as the file has them, in Pa
    flipped = raw + np.where(is_gauge, 0.0, ambient)
    found: list[tuple[bool, Explanation]] = []
    if inside(flipped, ranges) > BELIEVED:
        found.append((_spread(flipped, ranges) > LEAST_SPREAD, gauge_mistake(columns, is_gauge, shown)))
    for flip in (False, True):
        if flip and found:
            break
        for ratio, unit in PRESSURE_UNITS.items():
            gauge = is_gauge ^ flip
            tried = raw / ratio + np.where(gauge, ambient, 0.0)
            if inside(tried, ranges) > BELIEVED and _spread(tried, ranges) > LEAST_SPREAD:
                sort = (
                    ""
                    if not flip
                    else (", and they are absolute" if is_gauge.any() else ", and they are gauge pressure")
                )
                what = f"values {_times(ratio)}: {unit}{sort}"
                first = shown.split(",", maxsplit=1)[0]
                repair = (
                    f"write the right unit in the headings of {shown}: '{first} [unit]', '{first} [unit(g)]' for gauge"
                )
                mend = _sorted_mend(columns, is_gauge) if flip else Mend()
                if mend is not None:
                    mend = replace(mend, factors=dict.fromkeys(columns, 1.0 / ratio))
                found.append((True, Explanation(what, repair, mend)))
    # What leaves pressures that hardly move is the last to be believed.
    return tuple(explanation for _, explanation in sorted(found, key=lambda entry: not entry[0]))


def gauge_mistake(columns: Sequence[str], is_gauge: NDArray[np.bool_], shown: str | None = None) -> Explanation:
    """Gauge pressures without (g) in their headings, or absolute ones with it; the columns as ``shown``."""
    shown = shown or ", ".join(columns[:3])
    if is_gauge.any():
        what = "absolute pressure with a heading that says gauge pressure"
        repair = f"leave (g) out of the headings of {shown}: '{columns[0]} [kPa]'"
    else:
        what = "gauge pressure without (g) in its heading"
        repair = f"write (g) behind the unit of {shown}, as in '{columns[0]} [kPa(g)]'"
    return Explanation(what, repair, _sorted_mend(columns, is_gauge))


def _sorted_mend(columns: Sequence[str], is_gauge: NDArray[np.bool_]) -> Mend | None:
    """Gauge for absolute pressures or the reverse; none where the columns are of both sorts."""
    return Mend(gauge=not is_gauge.all(), pressures=tuple(columns)) if len(set(is_gauge.tolist())) == 1 else None


def _spread(pressures: Array, ranges: Array) -> float:
    """How much of the ranges the pressures use: all of a wrong unit may fit by shrinking to nothing."""
    return float(np.max((np.nanmax(pressures, axis=0) - np.nanmin(pressures, axis=0)) / (ranges[:, 1] - ranges[:, 0])))


def _vacuum(
    pressures: Array, ranges: Array, ambient: float, is_gauge: NDArray[np.bool_], columns: Sequence[str]
) -> tuple[Severity, str, tuple[Explanation, ...]] | None:
    """Absolute pressures near zero: gauge pressures without (g), most likely."""
    if is_gauge.any() or ambient <= 0.0:
        return None
    # All chambers near vacuum at once: an arm at rest in gauge pressure.
    least = float(np.nanmin(np.nanmax(pressures, axis=1)))
    single = float(np.nanquantile(pressures, 0.05))
    if min(least, single) >= VACUUM * ambient or inside(pressures + ambient, ranges, 0.5) < 0.5:
        return None
    severity: Severity = "fault" if single < ranges[:, 0].min() - TOLERANCE * ambient else "warning"
    what = f"absolute pressures of {_kilo(single)} kPa would be a vacuum that no bellows arm has"
    return (
        severity,
        what,
        (gauge_mistake(columns, is_gauge),),
    )


def _never_vented(
    pressures: Array, ranges: Array, ambient: float, is_gauge: NDArray[np.bool_], columns: Sequence[str]
) -> tuple[str, tuple[Explanation, ...]] | None:
    """Gauge pressures that never come below an atmosphere, and would all fit as absolute ones."""
    if not is_gauge.all() or ambient <= 0.0:
        return None
    least = float(np.nanmin(pressures)) - ambient
    if not 0.6 * ambient <= least <= 1.1 * ambient or inside(pressures - ambient, ranges) < BELIEVED:
        return None
    what = f"gauge pressures never come below {_kilo(least)} kPa, about ambient pressure"
    return what, (gauge_mistake(columns, is_gauge),)


def length_findings(ranges: Array, name: str, columns: Sequence[str], time: Array, lengths: Array) -> list[Finding]:
    """What bellows lengths (m, K), NaN where nothing counts, say beside their permitted ranges (K, 2), m."""
    if not len(columns) or not np.any(np.isfinite(lengths)):
        return []
    share = inside(lengths, ranges)
    low, high = float(np.nanmin(lengths)), float(np.nanmax(lengths))
    numbers = {"inside": share, "lowest": low, "highest": high}
    evidence = (
        f"{100 * share:.0f} % of the readings lie within length_range; they go from {1e3 * low:.4g} to "
        f"{1e3 * high:.4g} mm, the file permits {1e3 * ranges[:, 0].min():.4g} to {1e3 * ranges[:, 1].max():.4g} mm"
    )
    shown = ", ".join(columns[:3]) + (", ..." if len(columns) > 3 else "")
    if share < DOUBTED:
        fits = {
            unit: Mend(factors=dict.fromkeys(columns, 1.0 / ratio))
            for ratio, unit in LENGTH_UNITS.items()
            if inside(lengths / ratio, ranges) > BELIEVED
        }
        if fits:
            what = Explanation(
                f"another unit: {' or '.join(fits)}",
                f"write the right unit in the headings of {shown}: '{columns[0]} [mm]'",
                next(iter(fits.values())) if len(fits) == 1 else None,
            )
            return [
                Finding(
                    "fault",
                    "unit",
                    name,
                    "lengths are not in the unit that their headings say",
                    evidence,
                    numbers,
                    (what,),
                )
            ]
    outside = excursions(time, lengths, ranges, columns, "m")
    if not outside:
        return []
    repair = f"check the units of {shown}, and length_range and rest_length of the [[section]] in the arm's file"
    severity: Severity = "fault" if share < 0.2 else "warning"
    return [
        Finding(
            severity,
            "length_range",
            name,
            "lengths leave length_range",
            "; ".join(outside[:4]),
            numbers,
            (Explanation("unit, zero or range", repair),),
        )
    ]


def _kilo(pressure: float) -> str:
    return f"{pressure / 1e3:.4g}"


def _times(ratio: float) -> str:
    return f"{ratio:.4g} times too large" if ratio > 1 else f"{1 / ratio:.4g} times too small"
