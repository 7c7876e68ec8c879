"""The diagnosed arm as a parameter file: re-identified plain values and the named effects, each with its source."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bha._core import __version__
from bha.diagnosis.force_summary import FORCE_FILE, TABLE_FILE
from bha.diagnosis.model import of_wire, sensors_at
from bha.diagnosis.result import Made, NextExperiment, SourceFile
from bha.diagnosis.valves import is_of_valves
from bha.errors import FileError, InputError, way_out
from bha.estimation.engine import Model
from bha.estimation.free import with_values
from bha.estimation.preload import typical
from bha.parameters import paths
from bha.recordings.beginning import preloaded
from bha.support.files import check_target, written_whole

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.diagnosis.result import Diagnosis, Number
    from bha.diagnosis.splitting import Splitting
    from bha.diagnosis.workflow import Investigation
    from bha.logs import Log
    from bha.parameters.sensors import SensorsParameters
    from bha.recordings import Recording


#: The commands of the experiment that would split a class.
NEXT_EXPERIMENT = "next_experiment.csv"
#: The files of a diagnosis, each with what stands near its beginning.
RESULTS = {
    "diagnosis.json": re.compile(rb'"bha-diagnosis/'),
    "arm_diagnosed.toml": re.compile(rb'"bha-arm/'),
    "report.html": re.compile(rb"<title>Diagnosis of "),
    # Commands and nothing that was measured.
    NEXT_EXPERIMENT: re.compile(rb"\At \[s\](,pc[0-9_]+ \[Pa\])+\r?\n"),
    FORCE_FILE: re.compile(rb"\Alog,t \[s\],f[0-9_]+ \[N\],"),
    TABLE_FILE: re.compile(rb'"bha-residual/'),
}
_BEGINNING = 16_384


def check_results(folder: Path, *, report: bool) -> None:
    """Check that the results can be written, and that they replace those of an earlier diagnosis and nothing else.

    Raises:
        InputError: a file of that name is there and is none of a diagnosis.
        FileError: one cannot be written.
    """
    for name, mark in RESULTS.items():
        if name == "report.html" and not report:
            continue
        path = folder / name
        check_target(path)
        try:
            with path.open("rb") as file:
                begins = file.read(_BEGINNING)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise FileError(f"{path}: cannot be read: {way_out(error)}") from error
        if begins and mark.search(begins) is None:
            raise InputError(f"{path}: was not written by bha diagnose; move it away, or name another folder")


def write_results(folder: Path, found: Diagnosis, arm: Arm, page: str | None) -> None:
    """Write a diagnosis, the arm with what it found and, where there is one, the page of its report, each whole.

    Only after :func:`check_results`, which says that what they replace is of a diagnosis.
    """
    arm.save(folder / "arm_diagnosed.toml")
    if page is not None:
        with written_whole(folder / "report.html") as temporary:
            temporary.write_text(page, encoding="utf-8", newline="\n")
    found.write(folder / "diagnosis.json")
    remove_outdated(folder, found)


def remove_outdated(folder: Path, found: Diagnosis) -> None:
    """Remove what an earlier diagnosis left in the folder and this one does not have: a proposal, a residual force."""
    force = found.residual_force
    has = {
        NEXT_EXPERIMENT: found.next_experiment is not None,
        FORCE_FILE: force is not None and force.file is not None,
        TABLE_FILE: force is not None and force.table is not None,
    }
    for name, kept in has.items():
        if not kept:
            (folder / name).unlink(missing_ok=True)


def made_by(command: str, seed: int, train: Sequence[Recording], held: Sequence[Recording]) -> Made:
    """When and how a diagnosis of these logs is made, now."""
    files = [SourceFile(name=r.name, part="training", sha256=r.log.sha256) for r in train]
    files += [SourceFile(name=r.name, part="held out", sha256=r.log.sha256) for r in held]
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    return Made(date=now, version=__version__, command=command, seed=seed, files=files)


def experiment_of(proposal: Splitting, folder: Path | None) -> NextExperiment:
    """What a proposal is in the result; its commands are written into the folder where there is one."""
    if folder is not None:
        proposal.log().write(folder / NEXT_EXPERIMENT)
    return NextExperiment(
        members=list(proposal.members),
        distance=min(proposal.distance, 1e9),
        splits=proposal.splits,
        file=None if folder is None else NEXT_EXPERIMENT,
    )


def diagnosed_arm(arm: Arm, outcome: Investigation, logs: Sequence[Log]) -> Arm:
    """The arm with the values of the last model; provenance ``identified`` with intervals and the training logs."""
    mapping = arm.parameters.to_mapping()
    model, x = outcome.model, outcome.x
    references = [
        {"name": Path(log.path).name, "sha256": log.sha256}
        for log in logs
        if log.path is not None and log.sha256 is not None and len(log.sha256) == 64
    ]
    _write_plain(mapping, model, x, outcome, references)
    # A lag of the plain model that is a finding stands among its own numbers; what was added to them comes first.
    added = [(term.kind, term.where) for term in model.effects]
    named = {(effect.kind, effect.where): effect for effect in reversed(outcome.diagnosis.missing)}
    tables = [
        _effect_table(effect.kind, where, parameters, references)
        for key, effect in reversed(named.items())
        if effect.is_whole and key in added
        for where, parameters in (
            *((effect.where, e) for e in effect.elements or [effect.parameters]),
            *((c.where, c.parameters) for c in effect.corrections),
        )
    ]
    changes: dict[str, Any] = {"section": mapping["section"]}
    if sensors := sensors_at(model, x):
        changes["sensors"] = _sensors_table(arm, sensors, outcome, references)
    changes |= _valves_tables(arm, outcome, references) | _wires_tables(arm, outcome, references)
    if tables:
        changes["effect"] = [*changes.get("effect", mapping.get("effect", [])), *tables]
    made = arm.with_parameters(arm.parameters.updated(changes))
    return made.with_parameters(typical(made, model.records)) if preloaded(made.parameters) else made


def _effect_table(
    kind: str, where: str, parameters: Mapping[str, Number], references: list[dict[str, str]]
) -> dict[str, Any]:
    provenance: dict[str, Any] = {}
    for name, number in parameters.items():
        entry: dict[str, Any] = {"status": "identified" if number.ci95 is not None else "assumed"}
        if number.ci95 is not None:
            entry["ci95"] = list(number.ci95)
            if references:
                entry["logs"] = references
        provenance[name] = entry
    table: dict[str, Any] = {"kind": kind, "where": where, **{k: n.value for k, n in parameters.items()}}
    return table | ({"provenance": provenance} if provenance else {})


def _write_plain(
    mapping: dict[str, Any], model: Model, x: Any, outcome: Investigation, references: list[dict[str, str]]
) -> None:
    # What the model computes with at x says every derived value (inertia) too.
    core = model.with_effects([]).description(x[: len(model.plain)])
    intervals = {c.path: outcome.uncertainty[k] for k, c in enumerate(model.plain)}
    for i, (table, section, before) in enumerate(
        zip(mapping["section"], core["section"], model.core["section"], strict=True), start=1
    ):
        first, first_before = section["bellows"][0], before["bellows"][0]
        table["mass"] = section["mass"]
        table["inertia"] = section["inertia"]
        table["center_of_mass"] = section["center_of_mass"]
        if section.get("force_point") is not None:
            table["force_point"] = section["force_point"]
        table["bending_stiffness"] = section["bending_stiffness"]
        for key in ("rest_length", "damping", "terminal_area"):
            factor = first[key] / first_before[key] if first_before[key] else 1.0
            table[key] = first[key] if "bellows" not in table else table[key] * factor
        table["stiffness"] = first["stiffness"]
        for bellows, now in zip(table.get("bellows", []), section["bellows"], strict=False):
            for key in ("rest_length", "damping", "terminal_area", "stiffness"):
                if key in bellows:
                    bellows[key] = now[key]
        provenance = dict(table.get("provenance", {}))
        for key in ("mass", "rest_length", "damping", "terminal_area"):
            if (path := f"section.{i}.{key}") in intervals:
                provenance[key] = _entry(intervals[path], references)
        for key in ("inertia", "center_of_mass", "stiffness", "bending_stiffness"):
            provenance[key] = {"status": "identified", **({"logs": references} if references else {})}
        table["provenance"] = provenance


def _valves_tables(arm: Arm, outcome: Investigation, references: list[dict[str, str]]) -> dict[str, Any]:
    """``[pneumatics]`` and effects with the lag and the dead time of commands that were estimated."""
    own = [(k, c) for k, c in enumerate(outcome.model.plain) if is_of_valves(c)]
    if not own:
        return {}
    values = [c.value(float(outcome.x[k])) for k, c in own]
    mapping = with_values(arm.parameters, [c for _, c in own], values).to_mapping()
    for k, c in own:
        first, *rest = c.path.split(".")
        # Without a table for pneumatics in the file the lag is an effect.
        table = mapping["effect"][int(rest[0]) - 1] if first == "effect" else mapping["pneumatics"]
        entry = _entry(outcome.uncertainty[k], references)
        numbers = {path.rpartition(".")[2]: entry for path in c.members or (c.path,)}
        table["provenance"] = {**table.get("provenance", {}), **numbers}
    return {key: mapping[key] for key in ("pneumatics", "effect") if key in mapping}


def _wires_tables(arm: Arm, outcome: Investigation, references: list[dict[str, str]]) -> dict[str, Any]:
    """``[[length_sensor]]`` with where the wires run that was estimated."""
    own = [(k, c) for k, c in enumerate(outcome.model.plain) if of_wire(c)]
    if not own:
        return {}
    values = [c.value(float(outcome.x[k])) for k, c in own]
    tables = with_values(arm.parameters, [c for _, c in own], values).to_mapping()["length_sensor"]
    for k, c in own:
        _, number, key = c.path.split(".")
        table = tables[int(number) - 1]
        entry = _entry(outcome.uncertainty[k], references)
        table["provenance"] = {**table.get("provenance", {}), key: entry}
    return {"length_sensor": tables}


def _sensors_table(
    arm: Arm, sensors: SensorsParameters, outcome: Investigation, references: list[dict[str, str]]
) -> dict[str, Any]:
    """``[sensors]`` with the camera's estimated frame."""
    table: dict[str, Any] = arm.parameters.to_mapping().get("sensors", {})
    provenance = dict(table.get("provenance", {}))
    for key in ("camera_position", "camera_rotation"):
        own = [outcome.uncertainty[k] for k, c in enumerate(outcome.model.plain) if paths.key_of(c.path) == key]
        if own:
            table[key] = list(getattr(sensors, key))
            provenance[key] = _entry(own, references)
            table.pop(f"{key}_deg", None)
            provenance.pop(f"{key}_deg", None)
    return table | {"provenance": provenance}


def _entry(ci95: Any, references: list[dict[str, str]]) -> dict[str, Any]:
    interval = [list(pair) for pair in ci95] if isinstance(ci95, list) else list(ci95)
    return {"status": "identified", "ci95": interval, **({"logs": references} if references else {})}
