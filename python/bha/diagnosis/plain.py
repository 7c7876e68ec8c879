"""The plain model re-identified, from the file's values or, where these lead nowhere, from statics and a search.

What: the plain fit (:mod:`bha.diagnosis.baseline`) is a local one. A data sheet's values are near enough; those of a
tape measure are off by factors, and then the fit diverges or ends in another valley. Where it leaves much of the
motion, or nothing comes of it, it is made again from where an identification would begin
(:mod:`bha.estimation.begin`), and the better of the two counts. Where that leaves a gap on the logs of the fit, or its
numbers are farther from the file's than these plausibly are, the arm is identified with what labs know as priors, and
the fit made from there; it counts if it leaves no gap, or clearly less of one. Under commands a lag of two stages and a
dead time of all inputs are among its numbers (:mod:`bha.diagnosis.valves`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bha.arm import Arm
from bha.diagnosis.baseline import Baseline, fit_baseline, prepare_runs
from bha.diagnosis.cache import Cache
from bha.diagnosis.decide import faults_in_words
from bha.diagnosis.model import plain_model
from bha.diagnosis.rules import MATERIAL
from bha.diagnosis.valves import DELAY, LAG, Start, at, begun, coordinates_of, starts_of, with_valves
from bha.errors import BhaError, ConvergenceError, InputError
from bha.estimation.asked import AREA, stands_elsewhere
from bha.estimation.begin import Begin, begin
from bha.estimation.defaults import by_default
from bha.estimation.free import apply, resolve
from bha.estimation.preload import with_preloads
from bha.estimation.records import Record
from bha.estimation.refinement import refine, remembers
from bha.estimation.runs import Integration
from bha.estimation.scale import wires_free
from bha.estimation.settings import Settings, of_an_arm_that_creeps
from bha.parameters import ArmParameters
from bha.recordings.beginning import KIND as PRELOAD
from bha.recordings.beginning import preloaded
from bha.recordings.strained import KIND as MEMORY
from bha.runs.options import Method

if TYPE_CHECKING:
    from bha.checkup import Finding

Array = NDArray[np.float64]
Tell = Callable[[str, float | None], None]

#: Part of the motion (RMS over all outputs) that a plain fit may leave and still counts as found. Physics that is
#: missing leaves 0.01 to 0.15 of it in the blind worlds; a fit in the wrong valley 0.3 and more.
FOUND = 0.2
#: How rarely a file of which numbers are known as well as a plain model takes them to be is as far off as that.
IMPLAUSIBLE = 1e-3
#: The same of an arm that stands elsewhere after each use: what it remembers is missing, too. It is what a fit in the
#: wrong valley leaves at the least.
LOST = 0.3
#: Rows of an identification that is to find a start, s apart, and most steps of each of its stages: with 12 and 15 the
#: fit from there leaves as much (docs/decisions/0024).
START_INTERVAL, START_STEPS = 0.01, 8
#: The method for stiff arms.
STIFF: Method = "ros2"
#: Where the plain model of such an arm began under commands, for the notes.
_OF_FABRIC = "at what an identification of the logs finds, with areas that change with length (effect effective_area)"
#: Numbers of a section that have the scale of its forces.
FORCES = ("mass", "inertia", "stiffness", "damping", "bending_stiffness", "axial_stiffness", "terminal_area")


@dataclass(frozen=True)
class Plain:
    """The plain model.

    Attributes:
        arm: the arm whose values it began from, as its file would be: the file's own, or one moved from it.
        baseline: the fit.
        moved: where its first values come from, if they are not the file's; for the notes.
        faults: by what logs and file do not belong together: what was known, or what was doubted and is one, since the
            file's values lead nowhere.
    """

    arm: Arm
    baseline: Baseline
    moved: str = ""
    faults: tuple[Finding, ...] = ()

    @property
    def said(self) -> list[str]:
        """What is to be said of where it began, and where its logs did."""
        texts = []
        if preloaded(self.arm.parameters):
            texts.append(
                "the arm stands elsewhere under the same pressures after each use: what holds it where a log begins is "
                "told by that log's first pose (effect preload; the file has its mean)"
            )
        if self.moved:
            texts.append(f"the plain model began {self.moved}, not at the file's values")
        return texts

    @property
    def gap(self) -> float:
        """What it leaves of the training logs over their noise, RMS of the white residual."""
        return float(np.sqrt(self.baseline.fit.squares / self.baseline.problem.rows))

    @property
    def is_plausible(self) -> bool:
        """Whether its numbers are as far from the file's as these plausibly are, all together."""
        fit = self.baseline.fit
        return fit.prior <= float(stats.chi2.ppf(1.0 - IMPLAUSIBLE, max(1, fit.model.size)))

    @property
    def left(self) -> float:
        """Part of the motion of the training logs that it leaves, RMS over all outputs."""
        errors, motions = [], []
        for record, shown in zip(self.baseline.prepared.records, self.baseline.fit.outputs, strict=True):
            usable = record.usable
            errors.append((record.measured - shown)[usable])
            middle = np.nanmean(np.where(usable, record.measured, np.nan), axis=0)
            motions.append((record.measured - middle)[usable])
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2) / np.mean(np.concatenate(motions) ** 2)))


def remembering(arm: Arm, train: Sequence[Record]) -> Arm:
    """The arm with preloads, told by first poses, where logs show that it stands elsewhere after each use.

    What held it is no gap of the model then, nor noise that sets logs apart: the logs tell it themselves.
    """
    if preloaded(arm.parameters) or not stands_elsewhere(train):
        return arm
    return arm.with_parameters(with_preloads(arm.parameters))


@dataclass(frozen=True)
class PlainFits:
    """The fits of a plain model to some logs, from one start after the other.

    Attributes:
        arm: the file's arm.
        train: the training logs.
        commanded: whether their pressures are commands, which pass through the arm's pneumatics.
        camera: whether heads are seen, by a camera whose frame is free.
        faults: by what logs and file do not belong together; no other start is looked for then.
        doubts: by what they may not: faults where the file's values lead nowhere.
        seed: of draws.
        threads: of simulations.
        cache: of finished fits.
        scatter: what sets logs apart that begin alike, m, shape (channels,).
        tell: called with what is being done.
        searched: where an identification would begin if the file's values were not enough, once that was looked for.
    """

    arm: Arm
    train: Sequence[Record]
    commanded: bool
    camera: bool
    faults: Sequence[Finding]
    doubts: Sequence[Finding]
    seed: int
    threads: int | None
    cache: Cache
    scatter: Array | None
    tell: Tell
    searched: list[Begin] = field(default_factory=list)

    def best(self) -> Plain:
        """The plain model of the logs.

        Raises:
            ConvergenceError: the simulation diverges from every start.
            InputError: it diverges, and logs and file do not belong together.
        """
        wrong = [*self.faults, *self.doubts]
        fits: list[Plain] = []
        why: ConvergenceError | None = None
        if self._holds_off:
            for way in (self._of_fabric, self._begun_anew) if self.commanded else (self._begun_anew,):
                if (found := way()) is not None and found.left < LOST:
                    return found
                fits = [] if found is None else [found]
        try:
            first = self._fitted(self.arm, "")
            if first.left < FOUND or wrong:
                return self._settled(replace(first, faults=tuple(self.faults if first.left < FOUND else wrong)))
            fits.insert(0, first)
        except ConvergenceError as error:
            if wrong:
                raise InputError(f"{faults_in_words(wrong)}. With that {error}") from error
            why = error
        if not self._holds_off and (second := self._begun_anew()) is not None:
            fits.append(second)
        if not fits:
            assert why is not None
            raise why
        return self._settled(min(fits, key=lambda fit: fit.left))

    @property
    def _holds_off(self) -> bool:
        """Whether the arm stands elsewhere after each use: it creeps, and is damped more by orders of magnitude than a
        data sheet says."""
        return bool(preloaded(self.arm.parameters)) and not (self.faults or self.doubts)

    def _fitted(self, start: Arm, label: str, moved: str = "", *, identified: bool = False) -> Plain:
        """The fit from an arm's values; ``label`` tells the fits of the cache apart."""
        threads, train = self.threads, self.train
        starts = [Start({}, 1.0)] if identified else []
        if self.commanded:
            start = with_valves(start)
            if not identified:
                self.tell("looking for lag and dead time of the commands", None)
                if starts := starts_of(start, train, threads):
                    start = begun(start, starts[0])
        acting = start if self.commanded else start.with_changes(pneumatics="ideal")
        valves = coordinates_of(acting.parameters) if self.commanded else ()
        # What is seen otherwise is told by first poses where an arm stands elsewhere after each use.
        wires = () if preloaded(self.arm.parameters) else tuple(wires_free(self.arm.parameters, train))
        model = plain_model(acting, camera=self.camera, wires=wires, more=valves, identified=identified)
        model = replace(model, integration=Integration(threads=threads))
        self.tell("choosing the integration step", None)
        prepared = prepare_runs(model, train)
        model = replace(model.on(prepared.records), integration=prepared.integration(threads))
        self.tell("re-identifying the plain model", None)
        begins = [at(model, own) for own in starts]
        found = fit_baseline(
            model, prepared, self.seed, self.cache, self.scatter, label, starts=begins, near=identified
        )
        return Plain(start, found, moved)

    def _from(self, start: Arm | None, label: str, moved: str, *, identified: bool = False) -> Plain | None:
        with suppress(ConvergenceError):
            return None if start is None else self._fitted(start, label, moved, identified=identified)
        return None

    def _begun_anew(self) -> Plain | None:
        self.tell("looking for where to begin", None)
        self.searched.extend(_searched(self.arm, self.train, self.threads))
        start = _begun(self.arm, self.searched[0]) if self.searched else None
        return self._from(start, "begun", "where held poses and a search over dampings say")

    def _of_fabric(self) -> Plain | None:
        self.tell("identifying the arm", None)
        return self._from(_of_fabric(self.arm, self.train, self.threads), "fabric", _OF_FABRIC, identified=True)

    def _settled(self, found: Plain) -> Plain:
        """What was found, or where that leaves a gap the fit that an identification leads to, if that leaves less.

        With more that is free and priors of its own it may take up an effect; what is not needed is no finding. A fit
        at the noise that is far from its file goes by priors that do not hold, in all that its logs do not tell, too:
        it may be anywhere on others.
        """
        if (found.gap < MATERIAL and found.is_plausible) or self._holds_off or self.faults or self.doubts:
            return found
        self.tell("identifying the plain arm", None)
        start = _identified(self.arm, self.train, self.searched, found.baseline.fit.model.integration)
        other = self._from(start, "identified", "at what an identification of the logs finds", identified=True)
        return other if other is not None and other.gap < max(MATERIAL, found.gap / MATERIAL) else found


def _searched(arm: Arm, train: Sequence[Record], threads: int | None) -> list[Begin]:
    """Where an identification of these logs would begin if the file's values were not enough; none where it fails."""
    with suppress(BhaError):
        lagging, free = by_default(arm, train)
        return [begin(lagging, train, free, whole=remembers(lagging, train), enough=0.0, threads=threads)]
    return []


def _begun(arm: Arm, found: Begin) -> Arm | None:
    """The arm from which an identification would begin; None where that is the file's.

    Of commands without their lag and dead time, which are looked for anew from there.
    """
    if found.from_file:
        return None
    try:
        parameters = found.arm.parameters
        coordinates = resolve(parameters, found.free)
        moved = _without_valves(apply(parameters, coordinates, np.zeros(len(coordinates))), arm.parameters)
        return arm.with_parameters(_with_free_areas(moved, arm.parameters))
    except BhaError:
        return None


def _identified(arm: Arm, train: Sequence[Record], searched: Sequence[Begin], how: Integration) -> Arm | None:
    """The arm that an identification of these logs finds, valves of commands included; None where it finds none.

    Args:
        arm: the file's arm.
        train: the logs.
        searched: where it begins if the file's values are not enough, where that is known.
        how: how the plain model is integrated that has been fitted from elsewhere. What is found here is a start: it is
            fitted on at a step of its own.
    """
    settings = Settings(
        threads=how.threads, draws=0, prediction_error=False, interval=START_INTERVAL, max_iterations=START_STEPS
    )
    # An arm that is stiff may be none at the file's values; and the step is looked for where neither method runs.
    ways = [replace(settings, step=how.step, method=method) for method in dict.fromkeys((how.method, STIFF))]
    try:
        lagging, free = by_default(arm, train)
        start = begin(
            lagging, train, free, whole=remembers(lagging, train), known=next(iter(searched), None), threads=how.threads
        )
        for own in (*ways, settings):
            with suppress(ConvergenceError):
                found = refine(start.arm, train, start.free, own).arm
                break
        else:
            return None
        scaled = _at_the_files_scale(found.parameters, arm.parameters)
        return found.with_parameters(_with_free_areas(scaled, arm.parameters))
    except BhaError:
        return None


def _of_fabric(arm: Arm, train: Sequence[Record], threads: int | None) -> Arm | None:
    """The arm that an identification finds where an arm stands elsewhere after each use, without what slips in it.

    Of such an arm areas fall with length, as those of fabric do: its poses flatten as pressure grows, which under
    commands a model without passes for slow venting, by springs that no arm has. What slips is left to the search. None
    for an arm whose file has such areas, or what slips, and where it is not found to be held by what first poses tell.
    """
    if any(effect.kind in (AREA, MEMORY) for effect in arm.parameters.effects):
        return None
    try:
        lagging, free = by_default(_without(arm, PRELOAD), train)
        start = begin(lagging, train, free, whole=remembers(lagging, train), splits=True, threads=threads)
        settings = of_an_arm_that_creeps(Settings(threads=threads, draws=0, prediction_error=False))
        found = _without(refine(start.arm, train, start.free, settings).arm, MEMORY)
        moved = found.with_parameters(_with_free_areas(found.parameters, arm.parameters))
        return moved if preloaded(moved.parameters) else None
    except BhaError:
        return None


def _without(arm: Arm, kind: str) -> Arm:
    return arm.with_effects([effect for effect in arm.parameters.effects if effect.kind != kind])


def _at_the_files_scale(found: ArmParameters, file: ArmParameters) -> ArmParameters:
    """The parameters with all forces and masses times one number, which no motion tells, so that areas are the file's.

    Areas are what a diagnosis counts as known; an identification goes by masses. As they are where effects of the file
    have forces of their own.
    """
    if not all(effect.kind in (LAG, DELAY) for effect in found.effects):
        return found
    ratios = [
        before.terminal_area / own.terminal_area for own, before in zip(found.sections, file.sections, strict=True)
    ]
    factor = float(np.exp(np.mean(np.log(ratios))))
    mapping = found.to_mapping()

    def scaled(table: dict[str, Any]) -> dict[str, Any]:
        return {
            key: np.multiply(value, factor).tolist()
            if key in FORCES
            else [scaled(own) for own in value]
            if key in ("bellows", "masses")
            else value
            for key, value in table.items()
        }

    return found.updated({"section": [scaled(table) for table in mapping["section"]]})


def _without_valves(moved: ArmParameters, file: ArmParameters) -> ArmParameters:
    """The parameters with what lies between commands and chambers as the file has it."""
    own = file.to_mapping()
    return moved.updated({"effect": own.get("effect", []), "pneumatics": own.get("pneumatics")})


def _with_free_areas(moved: ArmParameters, file: ArmParameters) -> ArmParameters:
    """The parameters with areas that are not the file's marked as assumed: the plain fit then goes on with them."""
    mapping = moved.to_mapping()
    for table, own, before in zip(mapping["section"], moved.sections, file.sections, strict=True):
        if own.terminal_area != before.terminal_area:
            table["provenance"] = {**table.get("provenance", {}), "terminal_area": {"status": "assumed"}}
    return moved.updated({"section": mapping["section"]})
