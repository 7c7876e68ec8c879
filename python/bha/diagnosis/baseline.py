"""The plain model first: integration step, initial states, noise of a right model, re-identified parameters.

What: everything that has to be settled before a gap means anything. A wrong stiffness or an unknown initial state must
never be taken for physics.
Source: paper section IV for the plain parameters; issue of errors in variables: the pressure noise is part of the noise
model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.cache import Cache
from bha.diagnosis.fit import (
    FAR_STEP,
    Fit,
    Problem,
    as_measured,
    evaluate,
    improve,
    lowest,
    problem_of,
    weighted,
    whole_logs,
    with_sensitivities,
)
from bha.diagnosis.model import DAMPING_SPREAD, is_damping, of_camera, of_sensors
from bha.diagnosis.noises import Bound, bound_of, disturbed_outputs, mean_white_square, sensors_of
from bha.diagnosis.preparation import cut_to, preceded_in_motion, sound_records, thin, with_least_noise
from bha.diagnosis.rules import MATERIAL
from bha.diagnosis.slowness import plain_divisions
from bha.diagnosis.valves import is_of_valves, through, without_valves
from bha.errors import ConvergenceError, InputError
from bha.estimation.bands import (
    TOP_FREQUENCY,
    NoiseModel,
    noise_model,
)
from bha.estimation.engine import Model, root_mean_square
from bha.estimation.integration import (
    COARSE_ERROR_SHARE,
    COARSE_MISFIT_SHARE,
    FAR_OFF,
    MISFIT_SHARE,
    STEP_ERROR_SHARE,
    by,
    checked_rows,
    noise_of,
)
from bha.estimation.records import Record, Window, windows
from bha.estimation.runs import Integration
from bha.recordings.pose import tells_state
from bha.runs.options import Method

Array = NDArray[np.float64]

#: Methods of integration, the cheaper first.
METHODS: tuple[Method, ...] = ("rk4", "ros2")
#: Length of the pieces of the first fit, s.
WINDOW_TIME = 0.8
#: Rows of a piece, where rows are far apart.
WINDOW_ROWS = 12
#: Shares of the step that are tried in turn where a run diverges.
STEP_SHARES = (1.0, 0.5, 0.25)
#: Factors on the file's damping from which the plain model of a stiff arm is fitted, and how far off it plausibly is:
#: one standard deviation of its logarithm.
STIFF_DAMPINGS, STIFF_DAMPING_SPREAD = (1.0, 30.0), 2.3
#: Error over noise of a plain fit with a free camera from which the fit is tried from the file's camera too.
CAMERA_MISFIT = 2.0
#: Rounds of noise and fit at the most, and share of the bound of before from which another is not worth it; rounds at
#: the most where fits tell stray readings.
NOISE_ROUNDS, SAME_NOISE, STRAY_ROUNDS = 2, 0.8, 4
#: How often a fit begins anew from where it ended, and share of its cost for which it does once more.
ROUNDS, WORTH_A_ROUND = 3, 0.01


@dataclass(frozen=True)
class Prepared:
    """Logs made ready for a given arm and step.

    Attributes:
        records: thinned logs.
        full: the logs as they were.
        states: first guess of the initial states.
        step: step of the integration, s.
        coarse: step where only differences between runs are wanted, s.
        step_error: RMS difference to half the step, m.
        method: of integration.
        errors: the steps that were tried with that method and stay stable, s, and the error of each, m.
    """

    records: tuple[Record, ...]
    full: tuple[Record, ...]
    states: tuple[Array, ...]
    step: float
    coarse: float
    step_error: float
    method: Method = "rk4"
    errors: tuple[tuple[float, float], ...] = ()

    def integration(self, threads: int | None) -> Integration:
        """How runs are integrated; what diverges is repeated with finer steps."""
        return Integration(self.step, self.method, threads, self.coarse, shares=STEP_SHARES)

    def told_by(self, shown: Sequence[Array]) -> Prepared:
        """The same with what a model says of the readings by what it shows of each log, (rows, C); itself for nothing.

        Strays do not count, and noise is no more than what is left.
        """
        records = tuple(sound_records(self.full, self.records, shown))
        sound = self if records == self.full else replace(self, records=records, full=records)
        return sound.quieter(shown)

    def quieter(self, shown: Sequence[Array]) -> Prepared:
        """The same with no more noise than what a model leaves, (rows, C) shown of each log; itself where that is more.

        Differences of neighbouring readings, which tell noise, are motion where readings are few.
        """
        if any(record.thinning > 1 for record in self.records):
            return self
        squares = [np.where(r.usable, r.measured - y, np.nan) ** 2 for r, y in zip(self.records, shown, strict=True)]
        left = np.sqrt(np.nanmean(np.concatenate(squares), axis=0))
        pairs = [
            with_least_noise([r.with_noise(np.where(left < SAME_NOISE * r.noise, left, r.noise)) for r in own])
            for own in (self.records, self.full)
        ]
        fell = any(np.any(a.noise < SAME_NOISE * b.noise) for a, b in zip(pairs[0], self.records, strict=True))
        return replace(self, records=tuple(pairs[0]), full=tuple(pairs[1])) if fell else self

    def preceded(self, model: Model, x: Array) -> tuple[Prepared, Model]:
        """The same with what stood in the chambers before logs that begin in motion, by a model at ``x``; that too."""
        records = preceded_in_motion(model.on(self.records), x)
        thinned = any(len(record) != len(own) for record, own in zip(self.full, records, strict=True))
        changed = records != self.records
        found = replace(self, records=records, full=self.full if thinned else records) if changed else self
        return found, model.on(records)

    def longest_step(self, error: float) -> float:
        """The longest step with at most that error, s; ``step`` if there is none."""
        return max((step for step, found in self.errors if found <= error), default=self.step)


def prepare_runs(model: Model, records: Sequence[Record]) -> Prepared:
    """Choose the coarsest step whose error stays below the noise, thin the logs accordingly, guess initial states.

    The error of a step is the RMS difference to half of it on the first seconds of every log, measured, not assumed.

    Raises:
        ConvergenceError: the nominal arm diverges at every step tried, or no bellows is as short as a log begins.
    """
    nominal = np.zeros(model.size)
    sample = min(r.sample_time for r in records)
    # Rows may be thinned as long as the band that counts stays below their Nyquist frequency.
    factor = max([1, *(f for f in (2, 3, 4) if f * sample <= 0.4 / TOP_FREQUENCY)])
    thinned = tuple(thin(r, factor) for r in records)
    model = model.on(thinned)
    states = tuple(model.guesses(nominal, _whole(thinned)))
    refuse_impossible(thinned, states, model.sections)
    runs = model.runs(nominal, states, [checked_rows(r) for r in thinned])
    noise = noise_of(records)
    steps = [f * sample for f in range(factor, 0, -1)] + [sample / k for k in (2, 4, 8, 16, 32)]
    errors: dict[Method, list[tuple[float, float]]] = {method: [] for method in METHODS}
    for step in steps:
        # The implicit method costs more a step; arms whose damping outweighs their inertia are stiff and need it.
        for method in METHODS:
            tried = [by(model, method=method, step=step / k).integration.once() for k in (1.0, 2.0)]
            error = root_mean_square(*(integration.run(runs) for integration in tried))
            if not np.isfinite(error):
                continue
            errors[method].append((step, error))
            close = error <= COARSE_ERROR_SHARE * noise
            if error <= STEP_ERROR_SHARE * noise or (step == steps[-1] and method == "rk4"):
                full = tuple(cut_to(r, t) for r, t in zip(records, thinned, strict=True))
                found = Prepared(thinned, full, states, step, step, error, method, tuple(errors[method]))
                return replace(found, coarse=found.longest_step(COARSE_ERROR_SHARE * noise))
            if method == "rk4" and close:
                # Not stiff, only not exact enough: smaller steps of the cheap method do.
                break
    raise ConvergenceError(
        "the arm of the parameter file diverges under the pressures of these logs at every step tried; "
        "check that the file and the logs belong together (units and order of the pressures, rest lengths, stiffness)"
    )


def without_room(lengths: Array) -> tuple[int, float] | None:
    """The section, from 1, whose bellows have no length left between its stiff pieces, and that length, m; or None.

    ``lengths`` are those of a pose, m, shape (3n,).
    """
    means = lengths.reshape(-1, 3).mean(axis=1)
    section = int(np.argmin(means))
    return (section + 1, float(means[section])) if means[section] <= 0.0 else None


def refuse_impossible(records: Sequence[Record], states: Sequence[Array], sections: int) -> None:
    """Refuse first poses in which the arm of the file has no length left between its stiff pieces."""
    for record, state in zip(records, states, strict=True):
        if short := without_room(state[: 3 * sections]):
            section, length = short
            raise ConvergenceError(
                f"{record.name}: begins where the bellows of section {section} would be "
                f"{1e3 * length:.1f} mm long by the file's arm; allowed: more than 0; measure base_offset "
                "and head_offset of the file again, where its base and its markers are, and the units of the "
                "positions; or leave the log out"
            )


def _whole(records: Sequence[Record]) -> list[Window]:
    return [Window(k, 0, len(record)) for k, record in enumerate(records)]


def pieces(records: Sequence[Record], sections: int) -> list[Window] | None:
    """The logs in pieces of ``WINDOW_TIME``; None where pieces have no start: neither lengths nor heads were measured.

    Open loop over a whole log, an arm that is off by 15 per cent may run away, and so may every step of a fit from
    there; over a short time from the measured state it does not (multiple shooting: Bock 1983).
    """
    if not tells_state(records[0].observation, sections):
        return None
    try:
        return windows(records, max(WINDOW_TIME, *(WINDOW_ROWS * record.sample_time for record in records)))
    except InputError:
        return None


@dataclass(frozen=True)
class Baseline:
    """The re-identified plain model.

    Attributes:
        problem: the training logs with their final whitening.
        noise: the noise model.
        fit: the fit, with sensitivities.
        prepared: step and thinned logs.
        shaken: what the noise of the pressures does, mean square of white rows.
        bound: on what the noise of the pressures does.
    """

    problem: Problem
    noise: NoiseModel
    fit: Fit
    prepared: Prepared
    shaken: float
    bound: Bound


def _pieces_fit(model: Model, prepared: Prepared, rough: NoiseModel) -> tuple[Array, list[Array]]:
    """Plain parameters by multiple shooting, and guesses of the logs' initial states.

    Pieces are driven by what the valves make of commands where these begin: there a piece alone would know nothing of
    commands before it.
    """
    whole, parts, every = _whole(prepared.records), pieces(prepared.records, model.sections), model
    if parts is not None and any(is_of_valves(c) for c in model.plain):
        model = without_valves(model).on([through(model.parameters, record) for record in model.records])
    x = np.zeros(model.size)
    states = list(prepared.states if parts is None else model.guesses(x, parts))
    problem = problem_of(model, parts or whole, rough, np.stack(states))
    fit = improve(
        problem, evaluate(problem, model, x, states), iterations=20, tolerance=0.02, renewals=5, limit=FAR_STEP
    )
    if parts is None:
        return fit.x, list(fit.states)
    found = dict(zip((c.name for c in model.plain), fit.x, strict=True))
    x = np.array([found.get(c.name, 0.0) for c in every.plain])
    # By another camera, and other wires, outputs tell another pose.
    seen = any(of_sensors(c) for c in every.plain)
    return x, list(every.guesses(x, whole) if seen else prepared.states)


def _with_file_camera(
    model: Model, prepared: Prepared, problem: Problem, rough: NoiseModel, free: tuple[Array, list[Array]]
) -> tuple[Array, list[Array]]:
    """Plain parameters from pieces seen by the file's camera where these start a lower fit than ``free``.

    What an arm lacks may look like a camera elsewhere, over pieces that each begin as they please.
    """
    fits = _some_steps(problem, model, *free)
    if not fits or problem.misfit(fits[0]) > CAMERA_MISFIT:
        still = replace(model, plain=tuple(c for c in model.plain if not of_camera(c)))
        x, states = _pieces_fit(still, prepared, rough)
        fits += _some_steps(problem, model, np.concatenate([x, np.zeros(model.size - still.size)]), states)
    best = min(fits, key=lambda fit: fit.cost, default=None)
    return free if best is None else (best.x, list(best.states))


def _roughly(
    model: Model, prepared: Prepared, rough: NoiseModel, starts: Sequence[Array], *, near: bool
) -> tuple[Array, list[Array]]:
    """Plain parameters and initial states from which a fit to whole logs goes on, see :func:`fit_baseline`."""
    problem = whole_logs(model, rough, prepared.states)
    if prepared.method == "ros2":
        first = starts or [with_damping(model, np.zeros(model.size), factor) for factor in STIFF_DAMPINGS]
        return _damped_fit(model, prepared, problem, first)
    if near:
        fits = _some_steps(problem, model, np.zeros(model.size), list(prepared.states))
        return next(((fit.x, list(fit.states)) for fit in fits), (np.zeros(model.size), list(prepared.states)))
    found = _pieces_fit(model, prepared, rough)
    if any(of_camera(c) for c in model.plain):
        return _with_file_camera(model, prepared, problem, rough, found)
    return found


def _some_steps(problem: Problem, model: Model, x: Array, states: list[Array]) -> list[Fit]:
    """A fit that has gone on a little from a start; none where that diverges."""
    fit = evaluate(problem, model, x, states)
    if not np.isfinite(fit.cost):
        return []
    return [improve(problem, fit, iterations=10, tolerance=0.01, renewals=3, limit=FAR_STEP)]


def with_wide_damping(model: Model) -> Model:
    """The model with dampings that may plausibly be off by a factor of ten and more."""
    wider = STIFF_DAMPING_SPREAD / DAMPING_SPREAD
    plain = (replace(c, prior_deviation=wider * c.prior_deviation) if is_damping(c) else c for c in model.plain)
    return replace(model, plain=tuple(plain))


def with_damping(model: Model, x: Array, factor: float) -> Array:
    """Plain coordinates ``x`` with dampings at ``factor`` times the file's."""
    damped = (c.coordinate(factor * c.start) if is_damping(c) else None for c in model.plain)
    return np.array([v if d is None else d for v, d in zip(x, damped, strict=True)])


def _damped_fit(
    model: Model, prepared: Prepared, problem: Problem, starts: Sequence[Array]
) -> tuple[Array, list[Array]]:
    """Plain parameters and initial states of a stiff arm from whole logs, from several starts; the best fit counts.

    What is damped more than it weighs does not run away, so that whole logs can be fitted. Pieces would mislead: an arm
    that hardly moves fits each of them, from its own start, whatever the springs. How strong the damping is no swing
    tells, and files are off by orders of magnitude; a weak one hides in what the springs make up for.
    """
    nominal = evaluate(problem, model, np.zeros(model.size), prepared.states)
    quick = _integrated_for(model, prepared, nominal, problem).model
    fits = []
    for x in starts:
        fit = evaluate(problem, quick, x, prepared.states)
        if np.isfinite(fit.cost):
            fits.append(improve(problem, fit, iterations=40, tolerance=1e-3, renewals=12, limit=FAR_STEP))
    if not fits:
        raise ConvergenceError("the simulation diverges at the start of the fit; is the arm's file that of the logs?")
    best = min(fits, key=lambda fit: fit.cost)
    return best.x, list(best.states)


def _integrated_for(model: Model, prepared: Prepared, fit: Fit, problem: Problem) -> Fit:
    """The fit, with a longer step where it is off by so much more than noise that a share of that is enough.

    A step is known by its error at the file's values: it is kept where it shows the same arm here, too.
    """
    misfit = problem.misfit(fit)
    if not FAR_OFF < misfit < np.inf:
        return fit
    error = misfit * noise_of(prepared.records)
    step, coarse = (prepared.longest_step(share * error) for share in (MISFIT_SHARE, COARSE_MISFIT_SHARE))
    quick = replace(model, integration=replace(model.integration, step=step, coarse=coarse))
    found = evaluate(problem, quick, fit.x, fit.states, fit.trust)
    return found if root_mean_square(found.outputs, fit.outputs) <= MISFIT_SHARE * error else fit


def _to_its_end(problem: Problem, fit: Fit) -> Fit:
    """The fit with sensitivities of its own, gone on until nothing is left to gain; ``fit`` with its sensitivities.

    What a plain fit stopped short of any candidate's refit would gain, and pass for an effect.
    """
    fit = _gone_on(problem, fit)
    measured = as_measured(problem, fit)
    return fit if measured is fit else _gone_on(problem, measured)


def _gone_on(problem: Problem, fit: Fit) -> Fit:
    for _ in range(ROUNDS):
        more = improve(problem, fit, iterations=40, tolerance=2e-3, renewals=12, limit=FAR_STEP)
        if more.cost > (1.0 - WORTH_A_ROUND) * fit.cost:
            break
        fit = with_sensitivities(problem, more)
    return fit


def _otherwise_slow(problem: Problem, fit: Fit) -> Fit:
    """The fit, or where it ends lower one from a lag and dampings that divide what is slow under commands otherwise.

    Of a fit that leaves a gap: the other valley may have none (docs/decisions/0017).
    """
    starts = plain_divisions(fit.model, fit.x)
    best = lowest(problem, fit, starts, iterations=12, tolerance=0.01, renewals=4)
    return fit if best is fit else _to_its_end(problem, with_sensitivities(problem, best))


def fit_baseline(
    model: Model,
    prepared: Prepared,
    seed: int,
    cache: Cache | None = None,
    scatter: Array | None = None,
    label: str = "",
    *,
    starts: Sequence[Array] = (),
    near: bool = False,
) -> Baseline:
    """Re-identify the plain parameters and initial states, first with a coarse noise model, then with the right one.

    ``model`` is on the thinned logs; ``scatter`` is what sets logs apart that begin alike, m, shape (channels,);
    ``label`` tells the fits of one cache apart; ``starts`` are coordinates from which a stiff arm is fitted. Where
    there are none, factors on the file's damping are tried, here and in every fit that follows. Of an arm that is
    ``near`` whole logs are fitted at once: pieces, each from its own start, lead away from it.

    Raises:
        ConvergenceError: the nominal arm diverges under these logs.
    """
    cache = cache or Cache(None, "")
    prepared, model = prepared.preceded(model, np.zeros(model.size))
    records = prepared.records
    # Far from the minimum the shape of the noise does not matter, and a steep whitening makes for narrow valleys.
    rough = noise_model(records, [[] for _ in records])
    stiff = prepared.method == "ros2"
    if stiff:
        model = with_wide_damping(model)
    shapes = {"x": (model.size,), "states": np.shape(prepared.states)}
    known = cache.get("rough" + label, shapes)
    if known is None:
        x, states = _roughly(model, prepared, rough, starts, near=near)
        cache.put("rough" + label, x=x, states=np.array(states))
    else:
        x, states = known["x"], list(known["states"])
    prepared, model = prepared.preceded(model, x)
    records = prepared.records
    problem = whole_logs(model, rough, prepared.states, cache)
    fit = evaluate(problem, model, x, states)
    # At the step of the draws: what another makes of the same arm is no noise.
    fit = _integrated_for(model, prepared, fit, problem)
    if not all(np.isfinite(shown).all() for shown in fit.outputs):
        raise ConvergenceError("the simulation diverges at the start of the fit; is the arm's file that of the logs?")
    model = fit.model
    disturbed = disturbed_outputs(problem, fit, seed)
    bound = bound_of(records, fit.outputs, disturbed)
    for round_ in range(STRAY_ROUNDS):
        prepared, model = prepared.told_by(fit.outputs).preceded(fit.model, fit.x)
        records = prepared.records
        made = [bound(draws, record) for draws, record in zip(disturbed, records, strict=True)]
        sensors = sensors_of(prepared.full, records, fit.outputs, made)
        noise = noise_model(records, made, sensors, scatter)
        problem = whole_logs(model, noise, prepared.states, cache)
        name = f"plain{round_ or ''}{label}"
        known = cache.get(name, shapes)
        if known is None:
            fit = evaluate(problem, model, fit.x, fit.states)
            fit = improve(problem, fit, iterations=30, tolerance=2e-3, renewals=8, limit=FAR_STEP)
            cache.put(name, x=fit.x, states=np.array(fit.states))
        else:
            fit = weighted(problem, evaluate(problem, model, known["x"], list(known["states"])))
        # The bound is the tighter the better the fit is.
        before, bound = bound, bound_of(records, fit.outputs, disturbed)
        known_noise = round_ + 1 >= NOISE_ROUNDS or bool(np.all(bound.factors > SAME_NOISE * before.factors))
        # A better fit tells further strays.
        if known_noise and prepared.told_by(fit.outputs) is prepared:
            break
        bound = replace(bound, factors=np.minimum(bound.factors, before.factors))
    fit = _to_its_end(problem, with_sensitivities(problem, fit))
    if not near and problem.misfit(fit) > MATERIAL:
        fit = _otherwise_slow(problem, fit)
    if stiff and not starts:
        problem = replace(problem, restarts=(with_damping(model, fit.x, max(STIFF_DAMPINGS)),))
    shaken = mean_white_square(problem, made)
    return Baseline(problem, noise, fit, prepared, shaken, before)
