"""How often ``bha check`` finds made-up faults, and how often it finds one where there is none.

    python benches/check_faults.py             # the table of docs/guides/check.md; its first row: --only none --seeds 6
    python benches/check_faults.py --tune      # other seeds: thresholds were set on these
    python benches/check_faults.py --only tubes gravity --verbose

Each case is a simulated log of 30 s: an arm whose file is off (stiffness, and in the nulls azimuth, creep, camera),
random steps, sines or both, sensors with noise, sometimes held at 10 Hz. Logs have lengths, wires, heads, lengths and
heads, or the tip alone; measured pressures (noise, a grid of 640 Pa) or commands (a lag that the file does not have).
"""

from __future__ import annotations

import argparse
import copy
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bha
from bha import names
from bha.checkup import repaired
from bha.checkup.causes import Cause
from bha.checkup.layout import Layout, layout_of
from bha.parameters import ArmParameters

Array = NDArray[np.float64]

DURATION, RATE, AMBIENT = 30.0, 50.0, 101325.0
ARMS = ("one section", "two sections", "bha_nominal", "four columns", "asu_two_section", "asu_two_section_january",
        "asu_two_section_april")  # fmt: skip
SENSORS = ("lengths", "wires", "heads", "both", "tip")
FAULTS = (
    "none",
    "tubes",
    "cycle",
    "sections",
    "azimuth",
    "camera",
    "mirror",
    "axes",
    "sensors",
    "crossed",
    "gauge",
    "unit",
    "gravity",
)
NAMES = {
    "none": "no fault", "tubes": "two tubes exchanged", "cycle": "tubes exchanged in a cycle",
    "sections": "tubes of two sections exchanged", "azimuth": "azimuth of a section, 15 to 180 deg",
    "camera": "camera turned about the arm, 15 to 180 deg", "mirror": "camera mirrored",
    "axes": "camera's axes exchanged or reversed", "sensors": "two length sensors exchanged",
    "crossed": "length sensors of two sections exchanged",
    "gauge": "gauge read as absolute, or the reverse", "unit": "unit of pressures, lengths or heads",
    "gravity": "sign of gravity",
}  # fmt: skip
#: Arms in which the sign of gravity hides: too stiff for their weight, or of one section that hardly bends by it.
BLIND = ("one section", "asu_two_section_january", "asu_two_section_april")


@dataclass
class Case:
    """A made-up log, the arm's file, and what is wrong."""

    arm: bha.Arm
    log: bha.Log
    fault: str
    text: str
    feeds: tuple[int, ...] | None = None
    section: int = -1
    angle: float = 0.0
    pair: set[str] = field(default_factory=set)


def mapping_of(name: str) -> dict[str, Any]:
    """The mapping of an arm's file."""
    mapping = bha.robots.parameters(name if name in bha.robots.names() else "bha_nominal").to_mapping()
    if name in bha.robots.names():
        return mapping
    mapping["name"] = name
    if name != "four columns":
        mapping["section"] = mapping["section"][: 1 if name == "one section" else 2]
        return mapping
    section = {key: value for key, value in mapping["section"][0].items() if key != "provenance"}
    section |= {
        "mass": 0.43, "inertia": [1.5e-3, 1.5e-3, 4e-4], "bellows_radius": 0.03, "bellows_outer_radius": 0.02,
        "terminal_area": 6e-4, "rest_length": 0.29, "stiffness": [400.0], "damping": 15.0, "bending_stiffness": [0.05],
        "length_range": [0.2, 0.42], "pressure_range": [1.0e5, 1.6e5],
        "bellows": [{"angle_deg": 90.0 * k, "input": f"p1{k + 1}"} for k in range(4)],
    }  # fmt: skip
    mapping["section"] = [section]
    return mapping


def arm_of(mapping: dict[str, Any]) -> bha.Arm:
    """An arm of a mapping."""
    return bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))


def pressures(layout: Layout, random: np.random.Generator) -> tuple[Array, Array]:
    """Times and pressures: steps, sines or both, within the ranges."""
    low, high = layout.pressure_range.T
    moments = np.arange(round(DURATION * RATE) + 1) / RATE
    count, kind = len(low), random.choice(["steps", "sines", "both"])
    unit = np.zeros((len(moments), count))
    if kind != "sines":
        for j in range(count):
            row = 0
            while row < len(moments):
                last = row + int(random.uniform(1.0, 4.0) * RATE)
                unit[row:last, j] = random.uniform() * (random.random() < 0.7)
                row = last
        ramp = np.ones(round(0.2 * RATE)) / round(0.2 * RATE)
        before = len(ramp) - 1
        unit = np.column_stack([np.convolve(np.concatenate([np.full(before, u[0]), u]), ramp, "valid") for u in unit.T])
    if kind != "steps":
        lines = np.exp(random.uniform(np.log(0.05), np.log(2.0), (6, count)))
        waves = np.sin(2 * np.pi * lines * moments[:, None, None] + random.uniform(0.0, 6.28, (6, count))).sum(axis=1)
        waves /= np.abs(waves).max(axis=0)
        unit = 0.5 * unit + 0.25 + 0.25 * waves if kind == "both" else 0.5 + 0.4 * waves
    return moments, low + (high - low) * (0.1 + 0.6 * unit)


def make(name: str, sensors: str, fault: str, seed: int) -> Case | None:
    """A case; None where the fault cannot be made, or leaves nothing to see (an arm that bends in one plane)."""
    random = np.random.default_rng([seed, ARMS.index(name), SENSORS.index(sensors), FAULTS.index(fault)])
    mapping = mapping_of(name)
    n = len(mapping["section"])
    heads_seen, lengths_seen = sensors in ("heads", "both", "tip"), sensors in ("lengths", "both", "wires")
    if not _possible(name, n, sensors, fault, heads=heads_seen, lengths=lengths_seen):
        return None
    mapping["sensors"] = {"lengths": "coordinates"}
    if sensors == "wires":
        mapping["length_sensor"] = _wires(mapping)
    filed = arm_of(mapping)
    layout = layout_of(filed)
    case = Case(filed, None, fault, "", section=int(random.integers(n)))  # type: ignore[arg-type]
    true = _true_arm(mapping, case, random)
    plant = arm_of(true)
    moments, acting = pressures(layout, random)
    commanded = bool(random.random() < 0.4)
    drive = bha.Input(moments, acting, None, commanded)
    run = bha.simulate_batch(
        plant, drive, times=moments, method="ros2", step=4e-3, head_positions=True, velocities=False
    )
    if run.failures[0] is not None:
        return None
    assert run.head_positions is not None
    lengths, heads = run.lengths[0], run.head_positions[0]
    columns = _sensed(case, layout, sensors, moments, acting, lengths, heads, random, commanded=commanded)
    if columns is None:
        return None
    case.log = bha.Log.from_arrays(columns)
    case.text += f" {name}, {sensors}, {'commanded' if commanded else 'measured'}, seed {seed}"
    return case


def _possible(name: str, n: int, sensors: str, fault: str, *, heads: bool, lengths: bool) -> bool:
    if fault in ("camera", "mirror", "axes") and not heads:
        return False
    if fault == "sensors" and (not lengths or sensors == "wires"):
        return False
    if (fault == "sections" and n < 2) or (fault == "crossed" and (n < 2 or not lengths or sensors == "wires")):
        return False
    if sensors == "tip" and (n < 2 or fault in ("sections", "gravity")):
        return False
    if fault == "gravity":
        return name not in BLIND and (n > 1 or lengths)
    return True


def _true_arm(mapping: dict[str, Any], case: Case, random: np.random.Generator) -> dict[str, Any]:
    """The arm as it is: other than the file by stiffness, in nulls by creep and a little azimuth; by the fault."""
    true = copy.deepcopy(mapping)
    null = case.fault == "none"
    widest = np.log(3.0) if null else 0.4
    factor = float(np.exp(random.uniform(-widest, widest)))
    # Softer arms than the file's would leave their range of lengths under its pressures.
    factor = max(factor, 0.6) if true["name"] != "four columns" else factor
    turn = random.uniform(-5.0, 5.0) if null else 0.0
    if case.fault == "azimuth":
        turn = float(random.uniform(15.0, 180.0) * random.choice([-1, 1]))
        case.angle, case.text = turn, f"section {case.section + 1} by {turn:.0f} deg"
    for i, section in enumerate(true["section"]):
        section["stiffness"] = [factor * k for k in section["stiffness"]]
        section["bending_stiffness"] = [factor * k for k in section["bending_stiffness"]]
        section["damping"] = factor * section["damping"]
        if i == case.section and turn:
            bellows = section.get("bellows") or [{"angle_deg": 120.0 * k} for k in range(3)]
            section["bellows"] = [{**b, "angle_deg": b["angle_deg"] + turn} for b in bellows]
    if case.fault == "gravity":
        true["gravity"] = [-g for g in true["gravity"]]
    effects = []
    if null and random.random() < 0.5:
        softest = min(section["stiffness"][0] for section in true["section"])
        effects.append({"kind": "creep", "where": "all", "stiffness": float(0.3 * softest), "tau": 2.0})
    effects.append({"kind": "pressure_lag", "where": "all", "fill": 0.2, "vent": 0.4})
    true["effect"] = effects
    return true


def _wires(mapping: dict[str, Any]) -> list[dict[str, Any]]:
    """Three wires a section, those of outer sections through the inner ones."""
    return [
        {
            "name": f"wire{i}{k}",
            "angle_deg": 60.0 + 120.0 * k,
            "radius": 1.2 * mapping["section"][0]["bellows_radius"],
            "sections": list(range(1, i + 1)),
        }
        for i in range(1, len(mapping["section"]) + 1)
        for k in range(3)
    ]


def _feeds(case: Case, layout: Layout, random: np.random.Generator) -> tuple[int, ...] | None:
    """Which input each column of pressure shows; nothing where two tubes drive the arm alike."""
    own = layout.inputs_of(case.section)
    feeds = list(range(len(layout.inputs)))
    if case.fault == "tubes":
        a, b = (int(j) for j in random.choice(own, 2, replace=False))
        if np.isclose(layout.bending[case.section, a], layout.bending[case.section, b]):
            return None
        feeds[a], feeds[b] = b, a
    if case.fault == "cycle":
        for j, k in zip(own, np.roll(own, 1), strict=True):
            feeds[j] = int(k)
    if case.fault == "sections":
        first, second = (int(i) for i in random.choice(layout.section_count, 2, replace=False))
        for j, k in zip(layout.inputs_of(first), layout.inputs_of(second), strict=True):
            feeds[j], feeds[k] = k, j
    return tuple(feeds)


def _exchanged(case: Case, table: Array, random: np.random.Generator) -> Array:
    """Readings of length, of two sensors exchanged if that is the fault."""
    if case.fault == "sensors":
        a, b = (
            (0, int(random.integers(1, 3))) if case.arm.name.startswith("asu") else random.choice(3, 2, replace=False)
        )
        pair = [3 * case.section + int(a), 3 * case.section + int(b)]
        table[:, pair] = table[:, pair[::-1]]
    if case.fault == "crossed":
        first, second = random.choice(table.shape[1] // 3, 2, replace=False)
        pair = [3 * int(first) + int(random.integers(3)), 3 * int(second) + int(random.integers(3))]
        case.pair = {names.length_name(k // 3 + 1, k % 3 + 1) for k in pair}
        table[:, pair] = table[:, pair[::-1]]
    return table


def _camera(case: Case, heads: Array, random: np.random.Generator) -> Array:
    """Positions as the camera of the case gives them: always a little off, and wrong if that is the fault."""
    null = case.fault == "none"
    heads = heads @ _small_turn(random, 5.0 if null else 2.0).T
    heads = heads + (0.025 if null else 0.01) * random.standard_normal(3) / np.sqrt(3.0)
    if case.fault == "camera":
        case.angle = float(random.uniform(15.0, 180.0) * random.choice([-1, 1]))
        heads = heads @ _about_z(np.radians(case.angle)).T
    if case.fault == "mirror":
        axis = 0 if case.arm.name.startswith("asu") else int(random.integers(2))
        heads = heads * np.where(np.arange(3) == axis, -1.0, 1.0)
    if case.fault == "axes":
        order = [(2, 1, 0), (0, 2, 1), (1, 2, 0), (2, 0, 1)][int(random.integers(4))]
        heads = heads[..., order] * random.choice([-1.0, 1.0], 3)
    return heads


def _pressure_columns(layout: Layout, seen: Array, prefix: str, *, gauge: int, unit: int) -> dict[str, Array]:
    """Columns of pressure; gauge 0 leaves (g) out, gauge 1 adds it wrongly, unit 0 writes psi under bar."""
    columns: dict[str, Array] = {}
    for j, name in enumerate(layout.inputs):
        heading = prefix + name.removeprefix("p")
        if gauge == 0:
            columns[f"{heading} [kPa]"] = np.maximum(seen[:, j] - AMBIENT, 0.0) / 1e3
        elif gauge == 1:
            columns[f"{heading} [kPa(g)]"] = seen[:, j] / 1e3
        elif unit == 0:
            columns[f"{heading} [bar]"] = seen[:, j] / 6894.757
        else:
            columns[f"{heading} [Pa]"] = seen[:, j]
    return columns


def _output_columns(case: Case, sensors: str, measured: Array, positions: Array, *, unit: int) -> dict[str, Array]:
    """Columns of length and of position; unit 1 and 2 write millimetres under m."""
    columns: dict[str, Array] = {}
    n = positions.shape[1]
    if sensors in ("lengths", "both"):
        for k in range(3 * n):
            heading = names.length_name(k // 3 + 1, k % 3 + 1)
            columns[f"{heading} [{'m' if unit == 1 else 'mm'}]"] = 1e3 * measured[:, k]
    if sensors == "wires":
        for k, wire in enumerate(case.arm.parameters.length_sensors):
            columns[f"{wire.name} [m]"] = measured[:, k]
    for i in range(n):
        if sensors in ("heads", "both") or (sensors == "tip" and i == n - 1):
            for axis, heading in enumerate(names.position_names(i + 1)):
                columns[f"{heading} [{'m' if unit == 2 else 'mm'}]"] = 1e3 * positions[:, i, axis]
    return columns


def _wrong_unit(case: Case, sensors: str, random: np.random.Generator) -> int:
    """Which columns have the wrong unit: 0 pressures, 1 lengths, 2 positions, -1 none."""
    unit = int(random.integers(3)) if case.fault == "unit" else -1
    if unit == 1 and sensors not in ("lengths", "both"):
        unit = 0
    if unit == 2 and sensors not in ("heads", "both", "tip"):
        unit = 0
    return unit


def _sensed(
    case: Case, layout: Layout, sensors: str, moments: Array, acting: Array, lengths: Array, heads: Array,
    random: np.random.Generator, *, commanded: bool,
) -> dict[str, Array] | None:  # fmt: skip
    """Columns of the log, with the faults of tubes, sensors, camera and headings."""
    seen = acting + (0.0 if commanded else 200.0) * random.standard_normal(acting.shape)
    if not commanded and random.random() < 0.5:
        seen = 640.0 * np.round(seen / 640.0)
    feeds = _feeds(case, layout, random)
    if feeds is None:
        return None
    case.feeds = feeds

    table = _exchanged(case, lengths @ layout_rows(case.arm, sensors, layout.section_count).T, random)
    heads = _camera(case, heads, random)
    noise = 1e-3 if case.fault == "none" else 5e-4
    rows_seen = (np.arange(len(moments)) // 5) * 5 if random.random() < 0.5 else np.arange(len(moments))
    measured, positions = (values + noise * random.standard_normal(values.shape) for values in (table, heads))
    unit = _wrong_unit(case, sensors, random)
    gauge = int(random.integers(2)) if case.fault == "gauge" else -1
    prefix = "pc" if commanded else "p"
    return (
        {"t [s]": moments}
        | _pressure_columns(layout, seen[:, list(feeds)], prefix, gauge=gauge, unit=unit)
        | _output_columns(case, sensors, measured[rows_seen], positions[rows_seen], unit=unit)
    )


def layout_rows(arm: bha.Arm, sensors: str, n: int) -> Array:
    """Lengths over the coordinates: the coordinates themselves, or the wires."""
    if sensors != "wires":
        return np.eye(3 * n)
    from bha.arm.geometry import wire_row  # noqa: PLC0415

    return np.array([wire_row(arm.parameters, wire) for wire in arm.parameters.length_sensors])


def _about_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _small_turn(random: np.random.Generator, degrees: float) -> Array:
    axis = random.standard_normal(3)
    x, y, z = np.radians(degrees) * axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + cross + cross @ cross / 2.0


def named(case: Case, found: bha.Checkup) -> bool:
    """Whether the class of a finding holds what was made."""
    kinds = {finding.kind for finding in found.findings if finding.severity != "note"}
    # A unit that happens to look like gauge pressure is named as such, with the unit beside it.
    by_kind = {
        "gauge": {"gauge", "unit"}, "unit": {"gauge", "unit"}, "gravity": {"gravity"}, "axes": {"camera"},
    }  # fmt: skip
    if case.fault in by_kind:
        return bool(kinds & by_kind[case.fault])
    if case.fault == "crossed":
        said = [e.what for finding in found.faults for e in finding.explanations]
        return any(what.startswith("length sensors exchanged") and all(n in what for n in case.pair) for what in said)
    causes = found.verdict.causes if found.verdict is not None else ()
    return any(_is_cause(case, cause) for cause in causes)


def _is_cause(case: Case, cause: Cause) -> bool:
    """Whether a cause that the check found is what was made."""
    if case.fault in ("tubes", "cycle", "sections"):
        return cause.assignment.feeds == case.feeds
    if case.fault == "azimuth":
        turns = dict(zip(cause.sections, cause.turns, strict=True)) if cause.kind == "azimuth" else {}
        return case.section in turns and _near(turns[case.section], case.angle)
    if case.fault == "camera":
        return cause.kind == "camera" and not cause.mirrored and _near(cause.turns[0], case.angle)
    # Of a mirrored camera: an arm that bends in one plane looks turned by half a turn as well.
    return cause.kind == ("camera" if case.fault == "mirror" else "sensors")


def _near(turn: float, angle: float) -> bool:
    """Whether a turn in rad is an angle in degrees, to 12 degrees."""
    return abs((np.degrees(turn) - angle + 180.0) % 360.0 - 180.0) < 12.0


def cases(faults: list[str], seeds: range) -> Iterator[Case]:
    """All cases of some faults."""
    for seed in seeds:
        for fault in faults:
            for name in ARMS:
                for sensors in SENSORS:
                    case = make(name, sensors, fault, seed)
                    if case is not None:
                        yield case


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % bounds of a share."""
    if count == 0:
        return 0.0, 1.0
    z, share = 1.96, hits / count
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return max(0.0, middle - half), min(1.0, middle + half)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tune", action="store_true", help="the seeds on which thresholds were set")
    parser.add_argument("--seeds", type=int, default=2, help="cases of each kind, arm and sensors")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--only", nargs="+", choices=FAULTS, default=list(FAULTS))
    parser.add_argument("--verbose", action="store_true", help="print each miss")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    start = (0 if options.tune else 20_000) + options.first
    counts: dict[tuple[str, str], list[int]] = defaultdict(lambda: [0, 0, 0, 0])
    seconds = 0.0
    for case in cases(options.only, range(start, start + options.seeds)):
        sensors = case.text.split(", ")[-3].split(", ")[-1] if case.text else ""
        begin = time.perf_counter()
        found = bha.check(case.arm, case.log)
        seconds += time.perf_counter() - begin
        # An arm that is a third as stiff as its file says does leave the file's length_range: that is no false alarm.
        faults = [f for f in found.faults if case.fault != "none" or f.kind != "length_range"]
        # A gravity that only the poses speak for is a warning: rest lengths could be wrong instead.
        hit = bool(faults) or (case.fault == "gravity" and any(f.kind == "gravity" for f in found.findings))
        right = hit and case.fault != "none" and named(case, found)
        mended = bool(faults) and not repaired(case.arm, found.recordings).faults
        for key in ((case.fault, "all"), (case.fault, sensors)):
            counts[key][0] += 1
            counts[key][1] += hit
            counts[key][2] += right
            counts[key][3] += mended
        if options.verbose and (hit if case.fault == "none" else not right):
            print(f"{case.fault}: {case.text}: {[f.what for f in faults] or 'nothing'}", file=sys.stderr)
    print("| fault | cases | found | 95 % | truth in the class | mended | " + " | ".join(SENSORS) + " |")
    print("|---|---|---|---|---|---|" + "---|" * len(SENSORS))
    for fault in options.only:
        count, hits, right, mended = counts[fault, "all"]
        low, high = wilson(hits, count)
        by = " | ".join(f"{counts[fault, s][1]}/{counts[fault, s][0]}" if counts[fault, s][0] else "" for s in SENSORS)
        truth = "" if fault == "none" else str(right)
        print(
            f"| {NAMES[fault]} | {count} | {hits} | {100 * low:.1f} to {100 * high:.1f} % | {truth} | {mended} | {by} |"
        )
    total = sum(counts[fault, "all"][0] for fault in options.only)
    print(f"\n{total} cases, {1e3 * seconds / max(total, 1):.0f} ms a check")


if __name__ == "__main__":
    main()
