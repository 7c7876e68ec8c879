"""What follows something that was logged, and what does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import bha
from bha.diagnosis.absorbed import Absorption
from bha.diagnosis.decide import Decision
from bha.diagnosis.follows import Follows, follows, pieces_of
from bha.diagnosis.logged import CELL, Cells, mode_response
from bha.diagnosis.unlogged import Unlogged, periodic_share

from .synthetic import SAMPLE_TIME, one_section, pressures, simulated

Array = NDArray[np.float64]


def wandering(random: np.random.Generator, rows: int, columns: int, time: float) -> Array:
    """Ornstein-Uhlenbeck noise of unit size with a correlation time, s."""
    kept = np.exp(-CELL / time)
    made = np.empty((rows, columns))
    made[0] = random.standard_normal(columns)
    for k in range(1, rows):
        made[k] = kept * made[k - 1] + np.sqrt(1.0 - kept**2) * random.standard_normal(columns)
    return made


def about_mean(table: Array) -> Array:
    return np.asarray(table - table.mean(axis=0))


def logs(random: np.random.Generator, time: float, size: float, *, together: bool = False) -> list[Cells]:
    """Two logs of errors with a memory, and ``size`` of the fast regressors of one of two banks in them."""
    made = []
    for _ in range(2):
        fast, slow = wandering(random, 200, 40, 0.3), wandering(random, 200, 40, 1.0)
        errors = wandering(random, 200, 1 if together else 6, time) * np.ones(6)
        errors = errors + size * fast[:, :6]
        made.append(Cells(about_mean(errors), {"fast": about_mean(fast), "slow": about_mean(slow)}, CELL))
    return made


@pytest.mark.parametrize(("time", "together"), [(0.3, False), (3.0, True)])
def test_noise_with_a_memory_follows_nothing(time: float, together: bool) -> None:
    found = [follows(logs(np.random.default_rng(seed), time, 0.0, together=together), seed) for seed in range(4)]
    assert all(own is not None and (own.chance > 0.01 or own.share < 0.05) for own in found)


def test_a_twentieth_of_a_slow_disturbance_that_follows_what_was_logged_is_found() -> None:
    for seed in range(4):
        found = follows(logs(np.random.default_rng(seed), 3.0, 0.23), seed)
        assert found is not None
        assert found.bank == "fast"
        assert found.chance <= 0.01
        assert found.share >= 0.05


def fitted(seed: int) -> tuple[list[Cells], Absorption]:
    """Slow errors of two logs of which a fit of twelve numbers has taken from the first what it could."""
    random = np.random.default_rng(seed)
    parts, slopes = [], []
    for _ in range(2):
        pose = wandering(random, 160, 12, 2.0)
        slopes.append(about_mean(pose[:, None, :] * random.choice([-1.0, 1.0], (3, 12))))
        parts.append((about_mean(pose), about_mean(wandering(random, 160, 3, 2.0))))
    bent = Absorption(np.concatenate(slopes), np.repeat([True, False], 160), np.ones(3), np.full(12, 1e-3))
    errors = bent.left(np.concatenate([own for _, own in parts])[:, None, :])[:, 0]
    made = [
        Cells(about_mean(errors[160 * k : 160 * (k + 1)]), {"pose": parts[k][0]}, CELL, slopes[k]) for k in range(2)
    ]
    return made, bent


def test_errors_that_a_fit_has_made_follow_the_pose_by_chance() -> None:
    """What a wrong parameter does follows the pose; that it is wrong a disturbance has brought about."""
    plainly, known = [], []
    for seed in range(6):
        cells, bent = fitted(seed)
        as_is, as_fitted = follows(cells, seed), follows(cells, seed, bent)
        assert as_is is not None
        assert as_fitted is not None
        plainly.append(as_is.chance)
        known.append(as_fitted.chance)
        assert as_fitted.grown > 1.5
    assert sum(chance <= 0.01 for chance in plainly) >= 4
    assert min(known) > 0.01


def test_a_fit_of_errors_is_that_of_least_squares() -> None:
    _, bent = fitted(1)
    errors = np.random.default_rng(2).standard_normal((320, 2, 3))
    table = np.concatenate([bent.slopes[:160].reshape(-1, 12), np.sqrt(1e-3) * np.eye(12)])
    for draw in range(2):
        wanted = np.concatenate([errors[:160, draw].ravel(), np.zeros(12)])
        change = np.linalg.lstsq(table, wanted, rcond=None)[0]
        assert bent.left(errors)[:, draw] == pytest.approx(errors[:, draw] - bent.slopes @ change)


@pytest.mark.parametrize("own", [True, False])
def test_logs_that_are_all_of_one_sort_tell_no_growth(own: bool) -> None:
    _, bent = fitted(1)
    alone = replace(bent, own=np.full(320, own))
    errors = np.random.default_rng(2).standard_normal((320, 5, 3))
    assert alone.grown(alone.left(errors)).tolist() == [1.0] * 5


def test_pieces_are_of_one_log_each_and_about_equal() -> None:
    pieces = pieces_of([100, 300])
    assert pieces[99] < pieces[100]
    assert np.bincount(pieces).tolist() == [50] * 8


@pytest.mark.parametrize("mode", [-2.0 + 0.0j, -0.8 + 9.0j])
def test_a_mode_answers_to_straight_lines_as_its_differential_equation_does(mode: complex) -> None:
    random = np.random.default_rng(1)
    values = random.standard_normal((40, 1))
    grid = CELL * np.arange(40)

    def slope(time: float, z: Array) -> Array:
        return mode * z + np.interp(time, grid, values[:, 0] - values[0, 0])

    exact = solve_ivp(slope, (0.0, grid[-1]), [0.0j], t_eval=grid, rtol=1e-9, atol=1e-12, max_step=CELL / 4).y[0]
    found = mode_response(mode, CELL, values)
    assert found[:, 0] == pytest.approx(abs(mode) * exact.real, abs=1e-6)
    if mode.imag:
        assert found[:, 1] == pytest.approx(abs(mode) * exact.imag, abs=1e-6)


def test_a_sine_keeps_its_phase_and_ringing_does_not() -> None:
    random = np.random.default_rng(3)
    time = CELL * np.arange(200)
    sines = [np.sin(2 * np.pi * 0.83 * time + phase)[:, None] * [1.0, 0.5] for phase in (0.3, 2.0)]
    noisy = [(about_mean(sine + 0.4 * random.standard_normal(sine.shape)), CELL) for sine in sines]
    assert periodic_share(noisy) > 0.5
    ringing = []
    for _ in range(2):
        own, damping = 2 * np.pi * 0.83, 0.05
        y, rate, made = np.zeros(2), np.zeros(2), []
        for _ in time:
            for _ in range(10):
                rate += CELL / 10 * (-2 * damping * own * rate - own**2 * y) + random.standard_normal(2)
                y += CELL / 10 * rate
            made.append(y.copy())
        ringing.append((about_mean(np.array(made)), CELL))
    assert periodic_share(ringing) < 0.3


def pushed_logs(arm: bha.Arm, size: float, seconds: float) -> list[bha.Log]:
    """Logs of an arm in whose chambers an Ornstein-Uhlenbeck pressure (Pa, s) acts that they do not hold."""
    made = []
    for number, duration in enumerate((14.0, 10.0, 10.0)):
        random = np.random.default_rng([8, number])
        time = np.arange(round(duration / SAMPLE_TIME) + 1) * SAMPLE_TIME
        known = pressures(time, "multisine" if number % 2 else "steps", random)
        every = round(CELL / SAMPLE_TIME)
        coarse = size * wandering(random, len(time) // every + 2, 3, seconds)
        hidden = np.column_stack([np.interp(time, CELL * np.arange(len(coarse)), p) for p in coarse.T])
        lengths = simulated(arm, time, known + hidden, []) + 2e-4 * random.standard_normal((len(time), 3))
        columns = {"t [s]": time}
        columns |= {f"{name} [Pa]": known[:, k] for k, name in enumerate(arm.inputs)}
        columns |= {f"q1{k + 1} [m]": lengths[:, k] for k in range(3)}
        made.append(bha.Log.from_arrays(columns))
    return made


def test_an_arm_pushed_by_an_unlogged_pressure_is_equivalent_and_its_size_is_said() -> None:
    logs = pushed_logs(one_section(), 1200.0, 0.6)
    start = one_section({"mass": 0.93, "stiffness": 1.1, "damping": 1.12})
    found = bha.diagnose(start, logs[:2], logs[2:], kinds=("creep", "weak_bellows", "pressure_lag"))
    assert found.gap.significant
    assert found.gap.before > 2.0 * found.gap.noise
    assert (found.verdict, found.disturbed) == ("equivalent", True)
    force = found.residual_force
    assert force is not None
    assert force.table is None
    area = one_section().parameters.sections[0].terminal_area
    assert [line.rms / area for line in force.along] == pytest.approx([1200.0] * 3, rel=0.35)
    assert 0.3 < force.correlation_time < 1.2
    assert "something not logged pushed" in force.reason


def left_over(**changes: float) -> Unlogged:
    """Errors that follow nothing, but for some changes."""
    values = {"share": 0.02, "chance": 0.3, "explained": 0.0, "by_chance": 0.5, "periodic": 0.1, "grown": 1.1} | changes
    return Unlogged(
        logged=Follows(values["share"], values["chance"], "past", values.get("usual", 0.0), values.get("by_fit", 1.0)),
        explained=values["explained"],
        chance=values["by_chance"],
        periodic=values["periodic"],
        grown=values["grown"],
        offset=values.get("offset", 1.0),
        rms=2e-3,
    )


@pytest.mark.parametrize(("by_chance", "share", "needed"), [(0.5, 0.02, False), (0.02, 0.02, True), (0.5, 0.4, True)])
def test_a_candidate_that_chance_hardly_brings_is_refitted_before_anything_is_a_disturbance(
    by_chance: float, share: float, needed: bool
) -> None:
    """Its score is linear: a cubic spring that explains a fifteenth of the errors by it may explain all of them."""
    assert left_over(by_chance=by_chance, share=share).needs_no_search is not needed


def judged(decision: Decision, **changes: float) -> Decision:
    """The decision on such errors."""
    return left_over(**changes).judge(decision, 5e-4)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, "equivalent"),
        ({"share": 0.3, "chance": 0.003}, "unexplained"),  # it follows what was logged
        ({"share": 0.1}, "equivalent"),  # as chance does
        ({"share": 0.25}, "equivalent"),  # as chance does where errors are slow
        ({"share": 0.35}, "unexplained"),  # as chance may do, but that is much
        ({"share": 0.03, "chance": 0.003}, "equivalent"),  # no plain model is quite right
        ({"explained": 0.2, "by_chance": 0.005}, "unexplained"),  # a candidate explains a part of it
        ({"periodic": 0.5}, "unexplained"),  # a periodic force
        ({"grown": 3.0}, "unexplained"),  # the fit knew more of its own logs
        ({"grown": 3.0, "by_fit": 4.0}, "equivalent"),  # as a fit does that bends to a disturbance
        ({"offset": 8.0}, "unexplained"),  # a log far beside the others
    ],
)
def test_what_follows_nothing_is_no_gap_of_the_model(changes: dict[str, float], expected: str) -> None:
    made = judged(Decision("unexplained", "the search's own", 0.0), **changes)
    assert made.verdict == expected
    assert ("unlogged forces or pressures" in made.reason) == (expected == "equivalent")


@pytest.mark.parametrize(("usual", "said"), [(0.9, True), (0.2, False)])
def test_where_a_bent_fit_may_have_made_it_all_that_is_said(usual: float, said: bool) -> None:
    made = judged(Decision("unexplained", "the search's own", 0.0), share=0.7, usual=usual)
    assert made.verdict == "unexplained"
    assert ("do not tell whether it is physics" in made.reason) is said


def test_errors_that_are_larger_elsewhere_are_searched_before_anything_is_a_disturbance() -> None:
    assert left_over().needs_no_search
    larger = left_over(grown=2.0, by_fit=3.0)
    assert larger.is_a_disturbance
    assert not larger.needs_no_search


@pytest.mark.parametrize(("verdict", "closure"), [("named", 0.9), ("unexplained", 0.4), ("equivalent", 0.0)])
def test_what_effects_remove_is_the_search_s_own(verdict: str, closure: float) -> None:
    given = Decision(verdict, "the search's own", closure)
    assert judged(given) is given


@pytest.mark.parametrize(
    ("before", "changes", "verdict"),
    [
        (1.6e-3, {}, "named"),
        # Of two errors that are hardly unlike there is no name, and no gap either.
        (1.2e-3, {}, "equivalent"),
        # What is left follows something: the effect is not all that is missing.
        (1.6e-3, {"explained": 0.3, "by_chance": 0.005}, "unexplained"),
        (1.2e-3, {"explained": 0.3, "by_chance": 0.005}, "unexplained"),
    ],
)
def test_an_effect_above_a_disturbance_is_named_though_the_disturbance_stays(
    before: float, changes: dict[str, float], verdict: str
) -> None:
    given = Decision("unexplained", "the search's own", 0.44)
    made = left_over(**changes).complete(given, before, 1.0e-3)
    assert made.verdict == verdict
    assert ("not worth a name" in made.reason) is (verdict == "equivalent")
    assert verdict != "unexplained" or made is given
