"""One case of the wide world from its specification: arm, hidden physics, logs, the user's file, the sealed answer.

The folder of a case holds ``arm.toml``, ``train_1.csv`` .. and ``holdout_1.csv`` ..; all else is in the answer.
"""

import csv
import shutil
import time as clock
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sealing import seal, write_whole
from . import hidden
from .arms import TrueArm, build, draw_arm
from .bellows import B_REST, B_SECTION
from .datasheets import true_parameters, user_file
from .disturbances import Disturbance, Session, draw_disturbance, draw_sessions, unlogged
from .faults import Fault, draw_fault, swapped
from .hidden import KINDS, Effect
from .integrate import STEP, DivergedError
from .plan import WideSpec
from .pressures import UNITS, PressureSense, chamber_pressures, draw_pressures, log_pressures
from .programmes import GRID, LEAD, Timetable, commands, draw_timetable
from .reference import Drill, Meter, judgement
from .sensors import Channels, Measured, Sensors, draw_sensors, measure, observe, sample_rows
from .truth import Clean, Truth, plain_truth, simulate

Array = NDArray[np.float64]

FINE = 2  # steps a fine clean sample: 1 kHz
SPACING = FINE * STEP
LEAD_ROWS = round(LEAD / STEP)
# Seconds of each training log that strengths are set by: as long as it takes to see every chamber move.
CALIBRATED = {"rich": 12.0, "proposed": 25.0, "single": 30.0, "cycle": 40.0}
PAUSE = 60.0  # s between logs; a drift of stiffness goes on


@dataclass
class Log:
    """One log: chamber pressures on the fine grid, what is logged of pressures, what sensors say, and the truth."""

    name: str
    drill: Drill
    chamber: Array
    ripple: Array | None
    force: Array | None
    clean: Clean
    pressures: Array  # as logged, Pa absolute (rows, inputs)
    measured: Measured
    session: Session
    time: float


@dataclass
class Case:
    """All of a case, before it is written."""

    logs: list[Log]
    arm: TrueArm
    sensors: Sensors
    sense: PressureSense
    table: Timetable
    fault: Fault | None
    file: str
    answer: dict[str, Any]


def _drill(rng: np.random.Generator, arm: TrueArm, programme: str, table: Timetable, number: int) -> Drill:
    _, wanted = commands(rng, arm, programme, table, number)
    per = round(GRID / STEP)
    fine = np.repeat(wanted[:-1], per, axis=0)
    return Drill(np.concatenate([fine, wanted[-1:]]), LEAD_ROWS, table.durations[number])


def _in_session(truth: Truth, session: Session) -> Truth:
    """The truth on one day: rest lengths and the pressure of the surroundings a little other."""
    changed = truth.copy()
    for i, shift in enumerate(session.rest):
        changed.arm.table[changed.arm.table[:, B_SECTION] == i, B_REST] += shift
    changed.arm = changed.arm._replace(ambient=changed.arm.ambient + session.ambient)
    return changed


def _calibrated(meter: Meter, arm: TrueArm, effect: Effect, wanted: float) -> Effect:
    """Scale an amplitude within its limits until the gap is about ``wanted`` metres; where the arm diverges, halve."""
    low, high = KINDS[effect.kind].limits
    if low == high:
        return effect
    amplitude = effect.amplitude
    looks = 0
    for _ in range(9):
        truth, _ = hidden.install(meter.plain, arm, replace(effect, amplitude=amplitude))
        try:
            gap = meter.linear_gap(truth)
        except DivergedError:
            high = amplitude = 0.5 * amplitude
            continue
        ratio = float(np.clip(wanted / max(gap, 1e-12), 0.05, 20.0))
        amplitude = float(np.clip(amplitude * ratio, low, high))
        looks += 1
        if looks == 4 or (looks >= 2 and abs(np.log(ratio)) < 0.4):
            return replace(effect, amplitude=amplitude)
    raise DivergedError(f"{effect.kind} at {effect.where}: the true arm diverges at every amplitude tried")


def _logged(sense: PressureSense, rng: np.random.Generator, drill: Drill, chamber: Array, rows: int) -> Array:
    """Pressures at the rows of the log."""
    source = drill.command if sense.commanded else chamber
    picked = sample_rows(rows, STEP, source.shape[0] - drill.lead)
    return log_pressures(sense, rng, source[drill.lead + picked])


def _as_sensed(sense: PressureSense, log: Log, rows: int) -> Array:
    """Chamber pressures on the fine grid as somebody has them who knows the log and the valves: commands held and
    passed through the true valves, measured pressures linear between rows; before the log the true ones.
    """
    fine = log.chamber.shape[0] - log.drill.lead
    at = np.arange(fine) * STEP
    times = np.arange(log.pressures.shape[0]) / rows
    if sense.commanded:
        index = np.minimum(np.floor(at * rows + 1e-9).astype(np.int64), times.shape[0] - 1)
        command = np.concatenate([log.drill.command[: log.drill.lead], log.pressures[index]])
        return chamber_pressures(sense, command, STEP)
    columns = [np.interp(at, times, log.pressures[:, j]) for j in range(log.pressures.shape[1])]
    return np.concatenate([log.chamber[: log.drill.lead], np.stack(columns, axis=1)])


def _error(measured: Measured, channels: Channels, rows: int) -> Array:
    """Squared errors of fine clean channels at the sound samples of a log."""
    picked = sample_rows(rows, SPACING, channels.values.shape[0])[: measured.values.shape[0]]
    count = picked.shape[0]
    difference = measured.values[:count] - channels.values[picked]
    return np.asarray(difference[measured.sound[:count]] ** 2)


def _replayed(truth: Truth, sense: PressureSense, sensors: Sensors, log: Log, *, known: bool) -> Channels:
    """The true arm fed the pressures of the log; ``known``: disturbance and session too."""
    arm = _in_session(truth, log.session) if known else truth
    clean = simulate(
        arm,
        _as_sensed(sense, log, sensors.rows),
        log.drill.lead,
        STEP,
        FINE,
        ripple=log.ripple if known else None,
        force=log.force if known else None,
        start=log.clean.start,
        time=log.time,
    )
    return observe(sensors, arm, clean.coordinates, clean.heads)


def _rms(squares: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _floor_estimate(
    meter: Meter, sense: PressureSense, sensors: Sensors, disturbance: Disturbance, arm: TrueArm, rng: Any
) -> float:
    """Rough floor before anything is hidden: what pressure noise and disturbance do, and the sensors' noise."""
    drill = meter.drills[0]
    chamber = chamber_pressures(sense, drill.command, STEP)
    rows = chamber.shape[0]
    ripple, force = unlogged(disturbance, rng, arm, rows, STEP)
    if not sense.commanded:
        per = max(1, round(1.0 / (sensors.rows * STEP)))
        knots = np.arange(0, rows + per, per)
        # What is added is what the log's noisy samples, joined by lines, would do to a model that is fed them.
        size = np.hypot(sense.noise, sense.grid / np.sqrt(12.0))
        noise = size * rng.standard_normal((knots.shape[0], chamber.shape[1]))
        added = np.stack([np.interp(np.arange(rows), knots, noise[:, j]) for j in range(noise.shape[1])], axis=1)
        ripple = added if ripple is None else ripple + added
    clean = [
        simulate(meter.plain, chamber, drill.lead, STEP, 20, ripple=r, force=f)
        for r, f in ((None, None), (ripple, force))
    ]
    seen = [observe(sensors, meter.plain, c.coordinates, c.heads).values for c in clean]
    drift = disturbance.sort == "sessions"
    return float(np.sqrt(np.mean((seen[1] - seen[0]) ** 2) + sensors.noise**2 + (1.5e-3**2 if drift else 0.0)))


def _faulty_left(
    truth: Truth, sense: PressureSense, sensors: Sensors, arm: TrueArm, fault: Fault, drills: list[Drill]
) -> float:
    """RMS by which the true arm seen through the faulty setup misses itself, without any refit, m."""
    meter = Meter(truth, drills, sense, sensors)
    right = meter.outputs(truth)
    changed, seen, given = truth.copy(), sensors, drills
    if fault.kind == "gravity_sign":
        changed.arm.hidden.whole[:3] *= -1.0
    elif fault.kind == "camera_mirrored":
        seen = replace(sensors, mirrored=not sensors.mirrored)
    elif fault.kind == "azimuth":
        i = int(fault.where.split()[1]) - 1
        rows = changed.arm.table[:, B_SECTION] == i
        x, y = changed.arm.table[rows, 1].copy(), changed.arm.table[rows, 2].copy()
        c, s = np.cos(fault.angle), np.sin(fault.angle)
        changed.arm.table[rows, 1], changed.arm.table[rows, 2] = c * x - s * y, s * x + c * y
    elif fault.kind == "gauge_as_absolute":
        given = [replace(d, command=d.command - arm.ambient) for d in drills]
    elif fault.kind == "tubes_swapped":
        order = swapped(arm.inputs, fault)
        given = [replace(d, command=d.command[:, order]) for d in drills]
    else:
        names = observe(
            sensors, truth, np.zeros((1, 3 * len(arm.sections))), np.zeros((1, len(arm.sections), 12))
        ).names
        return float(np.sqrt(np.mean((right - right[:, swapped(names, fault)]) ** 2)))
    try:
        wrong = meter.outputs(changed, given, sense, seen)
    except DivergedError:
        return float("inf")
    return float(np.sqrt(np.mean((wrong - right) ** 2)))


def _channel_names(sensors: Sensors, sections: int) -> tuple[str, ...]:
    if sensors.sort == "coordinates":
        return tuple(f"q{i + 1}{k + 1}" for i in range(sections) for k in range(3))
    if sensors.sort == "wires":
        return tuple(w.name for w in sensors.wires)
    return tuple(f"{axis}{i + 1}" for i in sensors.heads for axis in "xyz")


def build_case(spec: WideSpec) -> Case:
    """Draw and simulate a case. Raises DivergedError when the arm cannot carry what is wanted."""
    begin = clock.process_time()
    root = np.random.SeedSequence([spec.seed, 20261129])
    names = ("arm", "file", "sensors", "pressures", "disturbance", "programme", "effect", "noise", "floor")
    rng = {name: np.random.default_rng(s) for name, s in zip(names, root.spawn(len(names)), strict=True)}
    arm = draw_arm(rng["arm"], spec.sections, spec.regime, spec.mounting, spec.layout)
    sensors = draw_sensors(
        rng["sensors"],
        arm,
        spec.sensors,
        spec.rate,
        spec.noise,
        spec.coloured,
        all_heads=spec.fault == "sensors_swapped" or "torsion" in spec.kinds,
    )
    sense = draw_pressures(rng["pressures"], spec.pressures)
    if spec.fault == "gauge_as_absolute":
        sense = replace(sense, unit="kPa(g)")
    table = draw_timetable(rng["programme"], spec.logs, spec.total, sense.commanded)
    fault = draw_fault(rng["effect"], spec.fault, arm, _channel_names(sensors, spec.sections)) if spec.fault else None
    if fault is not None and fault.kind == "camera_mirrored":
        sensors = replace(sensors, mirrored=True)
    disturbance = draw_disturbance(rng["disturbance"], spec.disturbance, arm)
    sessions = draw_sessions(rng["disturbance"], disturbance, spec.sections, spec.logs)
    drills = [_drill(rng["programme"], arm, spec.programme, table, k) for k in range(spec.logs)]
    train = spec.logs - table.holdout

    # The meter's plain model is the one that a product fits: lumped masses, polynomial springs.
    lumped = plain_truth(build(arm, plain=True), len(arm.inputs))
    meter = Meter(lumped, [d.shortened(CALIBRATED[spec.programme]) for d in drills[:train]], sense, sensors)
    truth = plain_truth(build(arm), len(arm.inputs))
    effects: list[Effect] = []
    rough = _floor_estimate(meter, sense, sensors, disturbance, arm, rng["floor"])
    if spec.kinds:
        chamber = chamber_pressures(sense, meter.drills[0].command, STEP)
        preview = simulate(lumped, chamber, LEAD_ROWS, STEP, 20).heads[:, :, :3]
        for kind, wanted in zip(spec.kinds, spec.strengths, strict=True):
            effect = hidden.draw_effect(kind, rng["effect"], arm, preview)
            effect = _calibrated(meter, arm, effect, wanted * rough)
            truth, filled = hidden.install(truth, arm, effect)
            effects.append(filled)

    logs: list[Log] = []
    for k, drill in enumerate(drills):
        chamber = chamber_pressures(sense, drill.command, STEP)
        ripple, force = unlogged(disturbance, rng["disturbance"], arm, chamber.shape[0], STEP)
        time = PAUSE * k + sum(table.durations[:k])
        today = _in_session(truth, sessions[k])
        clean = simulate(today, chamber, drill.lead, STEP, FINE, ripple=ripple, force=force, time=time)
        seen = measure(sensors, rng["noise"], observe(sensors, today, clean.coordinates, clean.heads), SPACING)
        logged = _logged(sense, rng["noise"], drill, chamber, sensors.rows)[: seen.time.shape[0]]
        logs.append(Log(table.names[k], drill, chamber, ripple, force, clean, logged, seen, sessions[k], time))

    held = logs[train:]
    errors = {
        known: [_error(x.measured, _replayed(truth, sense, sensors, x, known=known), sensors.rows) for x in held]
        for known in (False, True)
    }
    floor = _rms(errors[False])
    gap, relative = meter.refit(truth)
    limits = judgement(floor, meter.left_on(truth, relative, drills[train:]))
    limits |= {
        "true_model_knowing_the_disturbance": _rms(errors[True]),
        "sensor_noise": float(np.hypot(sensors.noise, sensors.grid / np.sqrt(12.0))),
        "plain_gap_on_training": gap,
        "rough_floor": rough,
        "by_log": {x.name: float(np.sqrt(np.mean(e))) for x, e in zip(held, errors[False], strict=True)},
        "travel": float(np.sqrt(np.mean([np.var(x.measured.values, axis=0).mean() for x in held]))),
    }
    if fault is not None:
        limits["fault"] = judgement(floor, _faulty_left(truth, sense, sensors, arm, fault, drills[train:]))
    answer = {
        "case": spec.case,
        "spec": asdict(spec),
        "effects": [_described(e, k == 0) for k, e in enumerate(effects)],
        "fault": None if fault is None else fault.summary(),
        "excused": _excused(arm, sense, disturbance),
        "limits": limits,
        "arm": asdict(arm),
        "parameters": true_parameters(arm),
        "sensors": asdict(sensors),
        "pressures": asdict(sense),
        "disturbance": asdict(disturbance),
        "sessions": [asdict(s) for s in sessions],
        "timetable": asdict(table),
        "seconds": clock.process_time() - begin,
    }
    text = user_file(rng["file"], arm, spec.quality, sensors, fault)
    return Case(logs, arm, sensors, sense, table, fault, text, answer)


def _described(effect: Effect, dominant: bool) -> dict[str, Any]:
    kind = KINDS[effect.kind]
    return {
        "kind": effect.kind,
        "where": effect.where,
        "known": not kind.refused,
        "dominant": dominant,
        "amplitude": effect.amplitude,
        "parameters": {**effect.shape, **effect.parameters},
        "comparable": {key: effect.parameters[key] for key in kind.comparable},
    }


def _excused(arm: TrueArm, sense: PressureSense, disturbance: Disturbance) -> list[str]:
    """Names that are true of a case although nothing was hidden: the valves' under commands, that of mass along the
    arcs, a drifting barometer's.
    """
    out = ["pressure_lag", "delay"] if sense.commanded else []
    out += ["distributed_mass"] if any(s.sliced for s in arm.sections) else []
    return [*out, "pressure_offset"] if disturbance.sort == "sessions" else out


def write_log(case: Case, log: Log, path: Path) -> None:
    """Write a log as CSV, with swapped columns where the setup is wrong."""
    prefix = "pc" if case.sense.commanded else "p"
    ambient = case.arm.ambient + log.session.ambient
    gauge = "(g)" in case.sense.unit
    unit = case.sense.unit
    if case.fault is not None and case.fault.kind == "gauge_as_absolute":
        unit = unit.replace("(g)", "")
    pressures = (log.pressures - (ambient if gauge else 0.0)) / UNITS[case.sense.unit]
    tubes = case.fault if case.fault is not None and case.fault.kind == "tubes_swapped" else None
    crossed = case.fault if case.fault is not None and case.fault.kind == "sensors_swapped" else None
    pressures = pressures[:, swapped(case.arm.inputs, tubes)]
    seen = log.measured
    values = seen.values[:, swapped(seen.names, crossed)]
    lengths = case.sensors.sort in ("coordinates", "wires")
    header = ["t [s]", *(f"{prefix}{x[1:]} [{unit}]" for x in case.arm.inputs)]
    header += [f"{x} [{'mm' if lengths else 'm'}]" for x in seen.names]
    digits = {"Pa": "%.1f", "kPa(g)": "%.4f", "bar": "%.6f"}[case.sense.unit]
    blocks = [
        (seen.time[:, None], "%.6g" if not case.sensors.ticks else "%.6f"),
        (pressures, digits),
        (1e3 * values if lengths else values, "%.4f" if lengths else "%.6f"),
    ]
    if seen.quaternions is not None:
        names = tuple(f"o{axis}{i + 1}" for i in case.sensors.heads for axis in "wxyz")
        header += [f"{x} [1]" for x in names]
        blocks.append((seen.quaternions[:, swapped(names, crossed)], "%.5f"))
    style = ",".join(kind for block, kind in blocks for _ in range(block.shape[1]))
    rows = np.concatenate([block for block, _ in blocks], axis=1)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(header)
        file.writelines(style % tuple(row) + "\n" for row in rows.tolist())


def write_case(spec: WideSpec, out: Path, sealed: Path, commitments: Path) -> dict[str, Any]:
    """Build a case, publish its commitment, seal its answer, then write file and logs to ``out``, whole or not at
    all.
    """
    case = build_case(spec)
    seal(case.answer, spec.case, sealed, commitments)
    temporary = out.with_name(out.name + ".part")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    write_whole(temporary / "arm.toml", case.file)
    for log in case.logs:
        write_log(case, log, temporary / f"{log.name}.csv")
    shutil.rmtree(out, ignore_errors=True)
    temporary.rename(out)
    return case.answer
