"""Hidden states that do not start at rest: what they are in the core, and that a fit finds them log by log."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.diagnosis.synthetic import one_section

import bha
from bha.estimation.engine import Model
from bha.estimation.free import FreeParameter, resolve
from bha.estimation.memories import remembering, within
from bha.estimation.records import Record, Window, record
from bha.runs.options import Options
from bha.simulation.batch import Batch, run_members

Array = NDArray[np.float64]

TIME = np.arange(0.0, 2.0, 5e-3)
AMBIENT = 101325.0
PRESSURES = np.full((len(TIME), 3), AMBIENT) + np.array([1e4, 2e4, 3e4])
#: One number a bellows.
MOVED = np.array([0.5, -0.25, 0.75])


def arm_with(kind: str, **numbers: float) -> bha.Arm:
    """One section with an effect in all of it."""
    return one_section().with_effects([{"kind": kind, "where": "all", **numbers}])


def run(arm: bha.Arm, moved: Array, pressures: Array = PRESSURES, *, members: int = 1, measured: bool = False) -> Batch:
    """The arm from where it stands under the first pressures."""
    state = np.concatenate([one_section().static_lengths(PRESSURES[0]), np.zeros(3)])
    drive = bha.Input(TIME, pressures).in_core()
    members_of = [(0, 0, 0)] * members
    options = Options("rk4", 2.5e-3)
    many = np.tile(moved, (members, 1)) * np.linspace(1.0, 0.0, members)[:, None] if members > 1 else moved[None]
    states = np.tile(state, (members, 1))
    begin = np.zeros(members)
    return run_members([arm], [drive], [TIME], members_of, begin, states, options, moved=many, measured=measured)


def lengths(arm: bha.Arm, moved: Array, pressures: Array = PRESSURES) -> Array:
    return run(arm, moved, pressures).lengths[0]


@pytest.mark.parametrize(
    ("kind", "numbers", "start", "size"),
    [
        ("hysteresis", {"amplitude": 5.0, "yield": 5e-3, "sharpness": 1.0}, "start", 1.0),
        ("creep", {"stiffness": 300.0, "tau": 0.5}, "strain", 0.02),
    ],
)
def test_what_bellows_remember_is_what_the_file_may_say_of_each(
    kind: str, numbers: dict[str, float], start: str, size: float
) -> None:
    each = [{"kind": kind, "where": f"bellows 1{k + 1}", **numbers, start: size * own} for k, own in enumerate(MOVED)]
    expected = lengths(one_section().with_effects(each), np.zeros(3))
    assert np.ptp(expected, axis=0).max() > 1e-4
    np.testing.assert_allclose(lengths(arm_with(kind, **numbers), MOVED), expected, atol=1e-13)


def test_a_band_holds_pressures_where_they_came_from() -> None:
    band = 5e3
    shifted = PRESSURES + band * MOVED
    found = lengths(arm_with("valve_dead_band", band=band), MOVED)
    np.testing.assert_allclose(found, lengths(one_section(), np.zeros(3), shifted), atol=1e-12)
    # No further than the band goes.
    np.testing.assert_array_equal(
        lengths(arm_with("valve_dead_band", band=band), np.array([9.0, 0.0, 0.0])),
        lengths(arm_with("valve_dead_band", band=band), np.array([1.0, 0.0, 0.0])),
    )


def test_a_lag_comes_from_other_pressures() -> None:
    tau = 0.3
    coming = PRESSURES + 5e4 * MOVED * np.exp(-TIME / tau)[:, None]
    found = lengths(arm_with("pressure_lag", fill=tau, vent=tau), MOVED)
    # Straight lines between samples instead of the exponential: (step / tau)^2 / 8 of it.
    np.testing.assert_allclose(found, lengths(one_section(), np.zeros(3), coming), atol=5e-6)
    assert np.abs(found - found[-1]).max() > 1e-3


def test_a_wire_with_play_reads_what_it_was_drawn_to() -> None:
    play = 2e-3
    arm = arm_with("wire_backlash", play=play)
    read, true = (run(arm, MOVED, measured=measured).lengths[0] for measured in (True, False))
    np.testing.assert_allclose(read[0] - true[0], play * MOVED, atol=1e-12)


def test_lanes_begin_each_where_it_stands() -> None:
    arm = arm_with("hysteresis", amplitude=5.0, **{"yield": 5e-3})
    together = run(arm, MOVED, members=5)
    for k, share in enumerate(np.linspace(1.0, 0.0, 5)):
        np.testing.assert_allclose(together.lengths[k], lengths(arm, share * MOVED), atol=1e-12)


def test_numbers_that_do_not_fit_are_refused() -> None:
    with pytest.raises(bha.InputError, match="moved"):
        run(one_section(), np.zeros(4))
    with pytest.raises(bha.InputError, match="finite"):
        run(one_section(), np.array([0.0, np.nan, 0.0]))


def test_only_what_remembers_and_moves_has_a_past() -> None:
    parameters = one_section().parameters
    effects = [("creep", "bellows 12"), ("valve_dead_band", "input p13"), ("payload", "section 1")]
    assert remembering(parameters, effects, commanded=False).tolist() == [False, True, True]
    # What commands before a log have led to is told elsewhere.
    assert not remembering(parameters, [("pressure_lag", "all")], commanded=True).any()
    assert remembering(parameters, [("pressure_lag", "all")], commanded=False).all()
    states = np.array([[0.1] * 6 + [3.0, -3.0, 0.5]])
    assert within(states, 3)[0].tolist() == [0.1] * 6 + [1.0, -1.0, 0.5]


def _log(arm: bha.Arm, moved: Array, rng: np.random.Generator) -> Record:
    """A log that begins in motion."""
    swing = np.sin(2.0 * np.pi * 0.7 * TIME[:, None] + np.array([0.3, 2.0, 4.0]))
    pressures = PRESSURES + 1e4 * swing
    shown = run(arm, moved, pressures).lengths[0]
    columns: dict[str, Any] = {"t [s]": TIME}
    columns |= {f"p1{k + 1} [Pa]": pressures[:, k] for k in range(3)}
    columns |= {f"q1{k + 1} [m]": shown[:, k] + 1e-5 * rng.standard_normal(len(TIME)) for k in range(3)}
    return record(one_section(), bha.Log.from_arrays(columns))


def test_derivatives_by_what_is_remembered_are_those_of_what_is_shown() -> None:
    arm = arm_with("valve_dead_band", band=5e3)
    rec = _log(arm, MOVED, np.random.default_rng(1))
    assert rec.resting is None
    free = resolve(arm.parameters, [FreeParameter("section.1.mass")])
    model = Model(arm.parameters, free, (rec,), remembers=True)
    window = Window(0, 0, len(rec))
    states = model.guesses(np.zeros(1), [window])
    assert states.shape == (1, 9)
    states[0, 6:] = MOVED
    ((_, _, by_state),) = model.linearize(np.zeros(1), [window], states)
    for place in (6, 7, 8):
        step = 1e-3 * np.eye(9)[place]
        ahead, behind = (model.predict(np.zeros(1), [window], states + sign * step)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(by_state[..., place], (ahead - behind) / 2e-3, atol=1e-6)
    # An arm without such an effect remembers nothing.
    plain = Model(one_section().parameters, free, (rec,), remembers=True)
    assert not plain.memories(window).any()
    ((_, _, none),) = plain.linearize(np.zeros(1), [window], states)
    assert not np.any(none[..., 6:])
