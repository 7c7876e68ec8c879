"""The residual force of a diagnosis that explains nothing: estimated, followed, certified on held-out logs, written.

Of a disturbance, which follows nothing that was logged, it is the size and the time, and no table is made of it.

The force is that beside the re-identified plain model, along training and held-out logs. What it follows is sought on
the training logs alone; a table of it is kept only if a simulation of the held-out logs from their beginning, open
loop, comes nearer to the measurement with it than without it.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.arm import Arm
from bha.diagnosis.force import ResidualForce, estimated
from bha.diagnosis.force_law import Law, follow
from bha.diagnosis.force_table import VARIABLES, ResidualTable
from bha.diagnosis.holdout import error_of, rms_errors, up_to_run_away
from bha.diagnosis.result import CarriedTable, ForceAlong, ResidualForceFound
from bha.errors import BhaError
from bha.estimation.bands import ar1_density
from bha.support.files import written_whole

if TYPE_CHECKING:
    from bha.diagnosis.workflow import Investigation
    from bha.estimation.bands import NoiseModel
    from bha.estimation.records import Record

Array = NDArray[np.float64]

FORCE_FILE, TABLE_FILE = "residual_force.csv", "residual_table.toml"
#: Least share by which a table must lower the error on held-out logs.
LEAST_GAIN = 0.05
#: Share of an unknown force's variance that readings must take away for it to count as told.
TOLD = 0.5
#: Band of a force, over the greatest one's RMS, that is small.
SMALL = 0.5
#: Two-sided 95 % of a normal distribution.
BAND = 1.96


@dataclass(frozen=True)
class Unexplained:
    """A residual force with what is said of it.

    Attributes:
        found: for ``diagnosis.json``.
        force: along the logs; None where there is none.
        law: what it follows; None where it follows nothing.
        table: that, where it predicts held-out logs better.
    """

    found: ResidualForceFound
    force: ResidualForce | None = None
    law: Law | None = None
    table: ResidualTable | None = None


def unexplained(outcome: Investigation, arm: Arm) -> Unexplained:
    """The residual force beside ``arm``, the diagnosed one."""
    if not outcome.diagnosis.complete:
        return Unexplained(ResidualForceFound(reason="no residual force: the search was interrupted"))
    try:
        return _unexplained(outcome, arm)
    except KeyboardInterrupt:
        return Unexplained(ResidualForceFound(reason="no residual force: its estimation was interrupted"))


def _unexplained(outcome: Investigation, arm: Arm) -> Unexplained:
    train, held = outcome.baseline.problem.records, outcome.holdout.problem.records
    records = [*train, *held]
    force = estimated(arm, records, _white(outcome.baseline.noise, records))
    if isinstance(force, str):
        return Unexplained(ResidualForceFound(reason=f"no residual force: {force}"))
    along = _along(force)
    if outcome.diagnosis.disturbed:
        text = _disturbance_in_words(along, force)
        return Unexplained(ResidualForceFound(reason=text, along=along, correlation_time=force.correlation_time), force)
    hidden = hidden_of(along)
    if len(hidden) == len(along):
        text = "no residual force: these readings do not tell it; more sensors, or all lengths, would"
        return Unexplained(ResidualForceFound(reason=text, along=along, correlation_time=force.correlation_time), force)
    law = follow(force, range(len(train)))
    table, reason = _certified(outcome, arm, law, [record.name for record in train])
    said = _in_words(along, force, hidden)
    found = ResidualForceFound(
        reason=f"{said}; {reason}", along=along, correlation_time=force.correlation_time, table=table and table[0]
    )
    return Unexplained(found, force, law, table and table[1])


def _white(noise: NoiseModel, records: Sequence[Record]) -> Array:
    """Standard deviation of white noise of the rows with the density that the noise has where it is slow, m."""
    record = records[0]
    low = np.array([0.0])
    density = [
        1.0
        if share <= 0.0
        else float((1.0 - share) + share * ar1_density(low, record.sample_time / record.thinning, time)[0])
        for share, time in noise.colours or [(0.0, 0.0)] * len(noise.sensor)
    ]
    return np.asarray(np.sqrt(noise.sensor**2 * np.array(density) / record.thinning + noise.repeat_part**2))


def _along(force: ResidualForce) -> list[ForceAlong]:
    squares = [np.mean(force.of_log(force.deviation, k) ** 2, axis=0) for k in range(len(force.names))]
    deviation = BAND * np.sqrt(np.average(squares, axis=0, weights=force.lasts))
    standard = force.arm.parameters.has_standard_bellows
    what = "bellows" if standard else "the coordinate at"
    return [
        ForceAlong(
            name=f"f{names.length_name(k // 3 + 1, k % 3 + 1)[1:]}",
            where=f"{what} {k % 3 + 1 if standard else f'{120 * (k % 3)} degrees'} of section {k // 3 + 1}",
            rms=float(rms),
            deviation=float(wide),
            told=float(told),
        )
        for k, (rms, wide, told) in enumerate(zip(force.rms, deviation, force.told, strict=True))
    ]


def hidden_of(along: Sequence[ForceAlong]) -> list[ForceAlong]:
    """Coordinates along which the readings do not tell the force.

    Where there is next to none its size has shrunk to what the readings leave open: small against the others, that
    is told.
    """
    greatest = max((line.rms for line in along if line.told >= TOLD), default=0.0)
    return [line for line in along if line.told < TOLD and line.deviation > SMALL * greatest]


def _in_words(along: Sequence[ForceAlong], force: ResidualForce, hidden: Sequence[ForceAlong]) -> str:
    greatest = max(along, key=lambda line: line.rms if line.told >= TOLD else 0.0)
    text = (
        f"{greatest.rms:.2g} N RMS (95 % band {greatest.deviation:.2g} N either side) along {greatest.where}, the most "
        f"of all, would have to act beside the model; it changes within {force.correlation_time:.2g} s"
    )
    if hidden:
        text += f"; these readings do not tell it along {', '.join(line.where for line in hidden)}"
    return text


def _disturbance_in_words(along: Sequence[ForceAlong], force: ResidualForce) -> str:
    """Size and time of a force that follows nothing, and the pressure that would make as much of it.

    The sizes are those that make the readings likeliest, and told where the force at any one time is not.
    """
    greatest = int(np.argmax(force.sizes))
    section = force.arm.parameters.sections[greatest // 3]
    areas = [bellows.terminal_area for bellows in section.resolved_bellows(greatest // 3 + 1)]
    size = float(force.sizes[greatest])
    return (
        f"something not logged pushed with {size:.2g} N RMS along {along[greatest].where}, the most of all, as "
        f"a pressure there does that is off by {size / float(np.mean(areas)):.2g} Pa, and changed within "
        f"{force.correlation_time:.2g} s"
    )


def _certified(
    outcome: Investigation, arm: Arm, law: Law | None, logs: list[str]
) -> tuple[tuple[CarriedTable, ResidualTable] | None, str]:
    """The table that predicts held-out logs better, and what is to be said of it or of why there is none."""
    if law is None:
        return None, "it follows neither length nor rate nor pressure of the bellows, so that no table of it is made"
    table = ResidualTable(schema="bha-residual/1", arm=arm.name, logs=logs, without=0.0, error=0.0, tables=law.tables)
    over = " and ".join(VARIABLES[name][0] for name in law.variables)
    try:
        before, after = _errors(outcome, table.carried(arm))
    except BhaError as error:
        return None, f"it follows {over}, but no arm can carry a table of that: {error}"
    if not after < (1.0 - LEAST_GAIN) * before:
        worse = f"{1e3 * after:.3g} mm" if np.isfinite(after) else "a motion that runs away"
        return None, f"it follows {over}, but a table of that predicts the held-out logs no better ({worse})"
    table = table.model_copy(update={"without": before, "error": after})
    carried = CarriedTable(
        variables=list(law.variables), shared=law.shared, explained=law.explained, before=before, after=after
    )
    text = (
        f"a table of it over {over} takes the error on held-out logs from {1e3 * before:.3g} to {1e3 * after:.3g} mm: "
        "a correction, no cause"
    )
    return (carried, table), text


def _errors(outcome: Investigation, arm: Arm) -> tuple[float, float]:
    """Error on the held-out logs, open loop, m RMS, of the plain model and of ``arm``, as ``gap`` counts it.

    That of an arm that runs away anywhere is infinite.
    """
    holdout, plain = outcome.holdout, outcome.plain.prediction
    problem, model = holdout.problem, outcome.model.on(holdout.problem.records)
    runs = [replace(run, arm=arm) for run in model.runs(outcome.x, plain.states)]
    raw = replace(model.integration, finer=1).run(runs)
    outputs, until = up_to_run_away(problem, raw)
    carried = holdout.compared(outputs, plain.states, until, error_of(problem, raw))
    before, after = rms_errors(plain, carried)
    return before, after if np.all(np.isinf(until)) else np.inf


def write_force(found: Unexplained, folder: Path) -> Unexplained:
    """Write force and table into a folder, and say where.

    Raises:
        FileError: a file cannot be written.
    """
    result = found.found
    if found.force is not None:
        _write_rows(found.force, folder / FORCE_FILE)
        result = result.model_copy(update={"file": FORCE_FILE})
    if found.table is not None:
        found.table.write(folder / TABLE_FILE)
        assert result.table is not None
        result = result.model_copy(update={"table": result.table.model_copy(update={"file": TABLE_FILE})})
    return Unexplained(result, found.force, found.law, found.table)


def _write_rows(force: ResidualForce, path: Path) -> None:
    """A row a time of each log: motion, pressures, and force with its 95 % band along each coordinate."""
    virtual = not force.arm.parameters.has_standard_bellows
    pairs = [(k // 3 + 1, k % 3 + 1) for k in range(force.force.shape[2])]
    length = names.coordinate_name if virtual else names.length_name
    rate = names.coordinate_velocity_name if virtual else names.velocity_name
    forces = [f"f{names.length_name(*pair)[1:]}" for pair in pairs]
    headings = ["log", names.column(names.TIME, "s")]
    headings += [names.column(f"{name}{end}", "N") for name in forces for end in ("", "_low", "_high")]
    headings += [names.column(length(*pair), "m") for pair in pairs]
    headings += [names.column(rate(*pair), "m/s") for pair in pairs]
    headings += [names.column(name, "Pa") for name in force.arm.inputs]
    with written_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(headings)
        for log, name in enumerate(force.names):
            middle, wide = (force.of_log(table, log) for table in (force.force, BAND * force.deviation))
            bands = np.stack([middle, middle - wide, middle + wide], axis=-1).reshape(len(middle), -1)
            time, q, qd, p = (
                force.of_log(table, log) for table in (force.time, force.lengths, force.rates, force.pressures)
            )
            for row in np.column_stack([time, bands, q, qd, p]):
                writer.writerow([name, *(f"{value:.7g}" for value in row)])
