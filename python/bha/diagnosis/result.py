"""``diagnosis.json``: what a diagnosis found, for machines. The schema is strict: what is written can be read back."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from bha.errors import InputError
from bha.parameters import EFFECT_KINDS
from bha.support.files import written_whole
from bha.support.shown import frame, html_table, number

#: ``named``: an effect, or several, each told from all others. ``one_of``: the same, but these logs cannot tell some of
#: them from others. ``equivalent``: no gap that matters. ``unexplained``: a gap that nothing known explains. ``setup``:
#: logs and file do not belong together, and that comes first.
Verdict = Literal["named", "one_of", "equivalent", "unexplained", "setup"]


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError(f"found {value}; allowed: a finite number")
    return value


Finite = Annotated[float, AfterValidator(_finite)]


class Table(BaseModel):
    """A table of the file: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Number(Table):
    """A number of an effect: value, unit, 95 % interval, and whether it sits on a bound of what is allowed."""

    value: Finite
    unit: str
    ci95: tuple[Finite, Finite] | None = None
    at_bound: bool = False


class Estimate(Number):
    """A plain parameter: the number that was estimated beside the one that the arm's file started with.

    Attributes:
        start: value of the file; None where the file has no such number.
    """

    start: Finite | None = None


class SourceFile(Table):
    """A log that took part: its name, its part, and the SHA-256 of its file where it has one."""

    name: str
    part: Literal["training", "held out"]
    sha256: str | None = None


class Made(Table):
    """When and how a diagnosis was made.

    Attributes:
        date: local time with its distance to UTC, ISO 8601.
        version: of the package.
        command: as it was typed, or the function that was called.
        seed: of all that was drawn.
        files: the logs, with hashes.
    """

    date: str
    version: str
    command: str
    seed: int
    files: list[SourceFile] = []


class Alternative(Table):
    """What these logs cannot tell from a named effect.

    Attributes:
        kind: as in a parameter file.
        where: as in a parameter file.
        parameters: its numbers in place of the named effect's, where it was refitted; else empty.
    """

    kind: str
    where: str
    parameters: dict[str, Number] = {}


class Correction(Table):
    """An effect of the same kind within the place of a named one or around it: it corrects that one's form.

    Attributes:
        where: as in a parameter file.
        parameters: its numbers.
    """

    where: str
    parameters: dict[str, Number]


class SlowSection(Table):
    """What a section shows of the lag of its pressures and its own damping together; which is which is not told.

    Attributes:
        section: its number.
        across: both together, of a motion across its axis, s.
        along: of a motion along it, s.
    """

    section: int
    across: Finite
    along: Finite


class Effect(Table):
    """A named effect.

    Attributes:
        kind: as in a parameter file.
        where: as in a parameter file.
        parameters: its numbers; of several elements together, see ``elements``.
        elements: where several branches or stages of the kind were found in its place (creep, hysteresis, lag), the
            numbers of each; ``parameters`` then has the sums of those that add up (stiffnesses, amplitudes, time
            constants in series), and of the others the mean of logarithms by these. Empty for a single one.
        confidence: share of block-bootstrap repeats that choose it, or what these data cannot tell from it, among its
            rivals: the confidence of the class.
        alone: the same of the effect alone.
        one_of: what these data cannot tell from it, the likeliest first.
        empirical: it helps to predict, but breaks a physical rule (creates energy, sits on a bound): a term, not a
            cause.
        experiment: what would tell it from those it is confused with, empty where nothing has to.
        gap_removed: share of the excess error on the held-out logs that it removes, beside the other effects named.
        slow: of a class "lag of the pressures or damping" the times that both have together; else empty.
        plain: whether it is part of the plain model: the lag and the dead time that every arm has between command and
            chamber. It is said where it is clearly there, whatever the verdict, and explains no gap. A lag that is told
            to be several times longer one way than the other is a finding, and not ``plain``.
        corrections: more of the same kind at nested places. Real effects have other forms than the catalogue's and
            differ between the bellows of an arm; such terms are no causes of their own.
    """

    kind: str
    where: str
    parameters: dict[str, Number]
    elements: list[dict[str, Number]] = []
    confidence: Finite = Field(ge=0.0, le=1.0)
    alone: Finite = Field(default=1.0, ge=0.0, le=1.0)
    one_of: list[Alternative] = []
    empirical: bool = False
    experiment: str = ""
    gap_removed: Finite = 0.0
    slow: list[SlowSection] = []
    plain: bool = False
    corrections: list[Correction] = []

    @property
    def is_whole(self) -> bool:
        """Whether it has all numbers that a parameter file needs; a family of which none is told has none."""
        needed = {p.name for p in EFFECT_KINDS[self.kind].parameters if p.default is None}
        return needed <= set(self.parameters)


class Gap(Table):
    """Open-loop error on the held-out logs: of a right model, of the re-identified plain one, with the effects.

    ``tolerance`` is what the user said matters, m, 0 for nothing: errors beyond noise below it are no gap.
    """

    metric: Literal["rms"] = "rms"
    unit: Literal["m"] = "m"
    noise: Finite
    before: Finite
    after: Finite
    holdout: list[str]
    significant: bool
    excess: Finite = 0.0
    excess_limit: Finite = 0.0
    tolerance: Finite = 0.0


class NextExperiment(Table):
    """Pressures that would split the first class.

    Attributes:
        members: what they set apart, ``kind at where``.
        distance: standard deviations between the two that stay nearest.
        splits: whether that is enough to tell all of them apart.
        file: where the commands are written, None where nothing is.
    """

    members: list[str]
    distance: Finite
    splits: bool
    file: str | None = None


class ForceAlong(Table):
    """The residual force along one coordinate, over all logs.

    Attributes:
        name: of its column in the file, ``f11``.
        where: ``bellows 1 of section 1``, or the coordinate where no bellows stands there.
        rms: of the force, N.
        deviation: half of its 95 % band, N, RMS.
        told: share of the variance of an unknown force that the readings have taken away.
    """

    name: str
    where: str
    rms: Finite
    deviation: Finite
    told: Finite


class CarriedTable(Table):
    """A table of the residual force that ``bha simulate --residual`` carries.

    Attributes:
        variables: over which its curves are: ``q``, ``qd``, ``p``.
        shared: whether the bellows of a section have the same ones.
        explained: share of the force's mean square that such curves explain on training logs left out.
        before: open-loop error on the held-out logs without it, m RMS.
        after: with it.
        file: where it is, None where nothing was written.
    """

    variables: list[str]
    shared: bool
    explained: Finite
    before: Finite
    after: Finite
    file: str | None = None


class ResidualForceFound(Table):
    """What would have to act beside the plain model: of the verdict ``unexplained``, and of a disturbance.

    Attributes:
        reason: in a sentence what it is like; or why there is none.
        along: a line a coordinate; empty where there is no force.
        correlation_time: over which it changes, s.
        table: what it follows, where that predicts held-out logs better.
        file: where the force is along the logs, None where nothing was written.
    """

    reason: str
    along: list[ForceAlong] = []
    correlation_time: Finite = 0.0
    table: CarriedTable | None = None
    file: str | None = None


class CandidateLine(Table):
    """A candidate: its score in the screening and, where it was refitted, what that gave.

    Attributes:
        kind: as in a parameter file.
        where: as in a parameter file.
        score: drop of the sum of squares of the white residual that it promises, over that sum.
        holdout: RMS error on the held-out logs after a refit, m, as ``gap`` has it; None where it was not refitted.
        bic: difference of the Bayesian information criterion to the plain model after a refit (negative is better).
        distance: difference to the best candidate's.
        detectable: least strength that these logs would show at three standard deviations, in the unit of its first
            number.
        unit: unit of ``detectable``.
    """

    kind: str
    where: str
    score: Finite
    holdout: Finite | None = None
    bic: Finite | None = None
    distance: Finite | None = None
    detectable: Finite | None = None
    unit: str = ""


class Diagnosis(Table):
    """Everything a diagnosis found.

    Attributes:
        verdict: ``named``, ``one_of``, ``equivalent``, ``unexplained`` or ``setup``.
        effects: the named effects, the strongest first, each with what it cannot be told from; empty unless ``named``
            or ``one_of``. Then, whatever the verdict, lag and dead time of commands where they are clearly there
            (``plain``).
        gap: open-loop error on held-out logs.
        where: where the error of the plain model sits: by channel, section, mode, band, time and region.
        candidates: all candidates, the most promising first.
        residual: what is left after the last model: whiteness, what it correlates with.
        excitation: what these logs can tell at all: classes of look-alikes, weak spots, the best next experiment.
        plain: re-identified plain parameters, each with what the file started with.
        setup: what is elsewhere than the file says without being physics of the arm (a camera), and what was repaired
            before the diagnosis; the faults that a check has found first. A text each.
        logs: training logs, with noise and flaws of every channel.
        reason: why the verdict is what it is, in a sentence.
        complete: whether the search came to its end; false after Ctrl-C, and where its time was over.
        unexamined: where its time was over, what it was about to examine; empty where it was not.
        seconds: time it took, s.
        next_experiment: pressures that would split the class, of the verdict ``one_of``.
        residual_force: of the verdict ``unexplained``, or of a disturbance, the force that would have to act beside the
            model.
        disturbed: whether the plain model is ``equivalent`` because its errors, greater than the noise of the sensors,
            follow nothing that was logged.
        made: when and how it was made; None in files of earlier versions.
        schema_name: version of this schema.
    """

    schema_name: Literal["bha-diagnosis/2"] = Field("bha-diagnosis/2", alias="schema")
    verdict: Verdict
    reason: str
    effects: list[Effect]
    gap: Gap
    where: dict[str, Any]
    candidates: list[CandidateLine]
    residual: dict[str, Any]
    excitation: dict[str, Any]
    plain: dict[str, Estimate]
    setup: list[str] = []
    logs: list[dict[str, Any]]
    complete: bool = True
    unexamined: str = ""
    seconds: Finite = 0.0
    next_experiment: NextExperiment | None = None
    residual_force: ResidualForceFound | None = None
    disturbed: bool = False
    made: Made | None = None

    @property
    def has_names(self) -> bool:
        """Whether effects are named, told from all others or not."""
        return self.verdict in ("named", "one_of")

    @property
    def missing(self) -> list[Effect]:
        """What the plain model lacks: the named effects without those of its own."""
        return [effect for effect in self.effects if not effect.plain]

    @property
    def of_commands(self) -> list[Effect]:
        """What lies between command and chamber, as part of the plain model."""
        return [effect for effect in self.effects if effect.plain]

    def __repr__(self) -> str:
        """Verdict and open-loop errors in a line."""
        named = ", ".join(f"{effect.kind} at {effect.where}" for effect in self.missing)
        errors = f"{1e3 * self.gap.before:.3g} mm before, {1e3 * self.gap.after:.3g} mm after"
        end = "" if self.complete else ", out of time" if self.unexamined else ", interrupted"
        verdict = f"{self.verdict}: {named}" if named else self.verdict
        return f"Diagnosis({verdict}; {errors}, noise {1e3 * self.gap.noise:.3g} mm{end})"

    def _repr_html_(self) -> str:
        """Verdict and named effects, for notebooks."""
        rows = [
            (
                effect.kind,
                effect.where,
                ", ".join(f"{name} {number(n.value)} {n.unit}".strip() for name, n in effect.parameters.items()),
                effect.confidence,
                effect.gap_removed,
                ", ".join(f"{other.kind} at {other.where}" for other in effect.one_of),
            )
            for effect in self.effects
        ]
        headings = ("effect", "where", "numbers", "confidence", "gap removed", "not told from")
        return html_table(repr(self), headings, rows, notes=[self.reason, *self.setup])

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` of all candidates, the most promising first: a row each, see ``candidates``.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        return frame({name: [getattr(c, name) for c in self.candidates] for name in CandidateLine.model_fields})

    def __str__(self) -> str:
        """The same line."""
        return repr(self)

    def to_json(self) -> str:
        """The text of ``diagnosis.json``."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), indent=1, allow_nan=False) + "\n"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write ``diagnosis.json``, whole or not at all.

        Raises:
            InputError: the folder does not exist.
        """
        with written_whole(path) as temporary:
            temporary.write_text(self.to_json(), encoding="utf-8", newline="\n")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Diagnosis:
        """Read a ``diagnosis.json``.

        Raises:
            InputError: the file is missing or not of this schema.
        """
        try:
            return cls.model_validate_json(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not a diagnosis: {error}") from error


def plain(value: Any) -> Any:
    """NumPy values as numbers and lists; what is not finite as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
