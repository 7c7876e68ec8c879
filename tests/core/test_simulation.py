"""Integrators against each other, against SciPy on the reference, and what a user may do wrong."""

from __future__ import annotations

import numpy as np
import pytest
from random_arms import Array, random_arm_text
from scipy.integrate import solve_ivp

import bha
from bha import reference as ref
from bha.parameters import ArmParameters

TEXT = random_arm_text(np.random.default_rng(5), 2, "work_conjugate")
ARM = bha.Arm.from_parameters(ArmParameters.from_toml(TEXT))
REST = np.full(6, 1.1e5)
END = 0.4


def pressures(t: float | Array) -> Array:
    """Smooth, so that the order of a method shows."""
    t = np.asarray(t, dtype=np.float64)
    return np.asarray(REST + 2e4 * np.sin(np.multiply.outer(t, 7.0 + np.arange(6))))


def smooth_input() -> bha.Input:
    """A straight line in time: linear interpolation is exact, also across samples."""
    return bha.Input(np.array([0.0, END]), np.vstack([REST, REST + np.linspace(2e4, -1e4, 6)]))


def run(**options: object) -> bha.Trajectory:
    q0 = ARM.static_lengths(REST) + 0.01 * np.sin(np.arange(6))
    return bha.simulate(ARM, smooth_input(), dt=END, q0=q0, qd0=0.2 * np.cos(np.arange(6)), **options)  # type: ignore[arg-type]


def reference_end() -> Array:
    drive, arm = smooth_input(), ref.parse_arm(TEXT, "random")
    slope = (drive.pressures[1] - drive.pressures[0]) / END
    q0 = ARM.static_lengths(REST) + 0.01 * np.sin(np.arange(6))
    right_hand_side = ref.right_hand_side(arm, lambda t: drive.pressures[0] + slope * t)
    start = np.concatenate([q0, 0.2 * np.cos(np.arange(6))])
    solution = solve_ivp(right_hand_side, (0, END), start, method="DOP853", rtol=1e-11, atol=1e-12)
    return np.asarray(solution.y[:, -1])


def test_integrators_agree_with_scipy_on_the_reference() -> None:
    expected = reference_end()
    for options in [
        {"method": "rk4", "step": 5e-4},
        {"options": bha.Options(rtol=1e-10, atol=1e-12)},
        {"options": bha.Options("rodas4", rtol=1e-9, atol=1e-11)},
    ]:
        end = run(**options)
        found = np.concatenate([end.lengths[-1], end.velocities[-1]])
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-8)


def test_rk4_is_of_order_four() -> None:
    exact = run(options=bha.Options(rtol=1e-13, atol=1e-14)).lengths[-1]
    errors = [np.abs(run(method="rk4", step=END / n).lengths[-1] - exact).max() for n in (160, 320, 640)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(orders > 3.8), orders
    assert np.all(orders < 4.5), orders


def test_dormand_prince_follows_its_tolerance() -> None:
    exact = run(options=bha.Options(rtol=1e-13, atol=1e-14)).lengths[-1]
    errors = [
        np.abs(run(options=bha.Options(rtol=r, atol=1e-2 * r)).lengths[-1] - exact).max() for r in (1e-5, 1e-7, 1e-9)
    ]
    assert errors[0] < 1e-4
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.05 * errors[1]


def test_dense_output_is_as_good_as_the_steps() -> None:
    options = bha.Options(rtol=1e-8, atol=1e-10)
    fine = bha.simulate(ARM, smooth_input(), dt=2e-4, options=options)
    exact = bha.simulate(ARM, smooth_input(), dt=2e-4, options=bha.Options(rtol=1e-12, atol=1e-13))
    assert fine.statistics["steps"] < len(fine) / 4
    assert np.abs(fine.lengths - exact.lengths).max() < 1e-7


def test_counts_are_those_of_the_method() -> None:
    statistics = run(method="rk4", step=1e-3).statistics
    assert statistics == {"steps": 400, "rejected_steps": 0, "evaluations": 1600}
    adaptive = run().statistics
    # Seven stages share one with the next step; two evaluations choose the first step.
    assert adaptive["evaluations"] == 3 + 6 * (adaptive["steps"] + adaptive["rejected_steps"])


def test_pieces_are_the_whole() -> None:
    drive = smooth_input()
    times = np.linspace(0, END, 101)
    whole = bha.Simulation(ARM, drive).advance(times)
    in_pieces = list(bha.Simulation(ARM, drive).run(times, chunk_rows=7))
    np.testing.assert_array_equal(np.vstack([p.lengths for p in in_pieces]), whole.lengths)


@pytest.mark.parametrize("method", ["dopri5", "rk4", "rodas4"])
def test_a_jump_is_not_smeared(method: str) -> None:
    """A jump between two output rows: the same as two runs that meet there."""
    low, high = REST, REST + 2e4
    jump = bha.Input(np.array([0.0, 0.1234, 0.1234, 0.3]), np.vstack([low, low, high, high]))
    options = bha.Options(method=method, step=1e-3, rtol=1e-10, atol=1e-12)  # type: ignore[arg-type]
    found = bha.Simulation(ARM, jump, options).advance([0.3])
    first = bha.Simulation(ARM, bha.Input.constant(low, 0.1234), options).advance([0.1234])
    second = bha.Simulation(
        ARM, bha.Input.constant(high, 0.1766), options, q0=first.lengths[-1], qd0=first.velocities[-1]
    ).advance([0.1766])
    np.testing.assert_allclose(found.lengths[-1], second.lengths[-1], rtol=0, atol=1e-9)
    held = bha.Input(np.array([0.0, 0.1234, 0.3]), np.vstack([low, high, high]))
    options = bha.Options(method=method, step=1e-3, rtol=1e-10, atol=1e-12, interpolation="hold")  # type: ignore[arg-type]
    again = bha.Simulation(ARM, held, options).advance([0.3])
    np.testing.assert_allclose(again.lengths[-1], second.lengths[-1], rtol=0, atol=1e-9)


def test_an_input_says_what_holds_between_its_samples() -> None:
    """Options decide only where they say something; batches mix inputs that hold with others."""
    time, p = np.array([0.0, 0.1, 0.3]), np.vstack([REST, REST + 2e4, REST])
    held, line = bha.Input(time, p, interpolation="hold"), bha.Input(time, p)
    by_option = {name: bha.Options(interpolation=name) for name in ("hold", "linear")}  # type: ignore[arg-type]
    ends = {
        "hold": bha.simulate(ARM, held, dt=0.1).lengths[-1],
        "linear": bha.simulate(ARM, line, dt=0.1).lengths[-1],
    }
    assert np.abs(ends["hold"] - ends["linear"]).max() > 1e-4
    for name, end in ends.items():
        for drive in (held, line):
            np.testing.assert_array_equal(bha.simulate(ARM, drive, dt=0.1, options=by_option[name]).lengths[-1], end)
    batch = bha.simulate_batch(ARM, [line, held, line], times=[0.0, 0.3], method="dopri5")
    for found, name in zip(batch.lengths[:, -1], ("linear", "hold", "linear"), strict=True):
        np.testing.assert_allclose(found, ends[name], rtol=0, atol=1e-7)


def test_rest_stays_at_rest() -> None:
    still = bha.simulate(ARM, bha.Input.constant(REST, 1.0), dt=0.1)
    assert np.abs(still.lengths - still.lengths[0]).max() < 1e-9


def test_external_force_from_the_input() -> None:
    force = np.array([[[0.0, 0.0, 0.0], [0.5, 0.0, -0.2]]] * 2)
    drive = bha.Input(np.array([0.0, 60.0]), np.vstack([REST, REST]), force)
    end = bha.simulate(ARM, drive, dt=60.0, q0=ARM.static_lengths(REST)).lengths[-1]
    np.testing.assert_allclose(end, ARM.static_lengths(REST, force[0]), rtol=0, atol=1e-6)


def test_divergence_keeps_what_was_computed() -> None:
    unstable = TEXT.replace("\nstiffness = [", "\nstiffness = [-9e4, ")
    arm = bha.Arm.from_parameters(ArmParameters.from_toml(unstable))
    with pytest.raises(bha.SimulationError, match=r"stopped at t = [0-9.]+ s: section [12]") as caught:
        bha.simulate(arm, bha.Input.constant(REST, 5.0), dt=1e-3, q0=np.full(6, 0.2))
    assert 0 < caught.value.time < 5
    assert len(caught.value.trajectory) > 0
    assert np.isfinite(caught.value.trajectory.lengths).all()
    assert caught.value.trajectory.time[-1] <= caught.value.time


def test_a_step_limit_is_an_error_that_says_so() -> None:
    with pytest.raises(bha.SimulationError, match="limit of 10 steps"):
        run(options=bha.Options(max_steps=10))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"pressures": np.zeros((2, 5))}, r"pressures: expected shape \(any, 6\), found \[2, 5\]"),
        ({"times": [0.0, np.nan]}, "time: element 1 is NaN"),
        ({"times": [1.0, 0.0]}, "backwards from 1 to 0 s at sample 1"),
        ({"times": [0.0, 1.0, 2.0]}, "pressures: 12 values; 3 samples of 6"),
        ({"q": np.zeros(5)}, r"q: expected shape \(6,\), found \[5\]"),
        ({"method": "euler"}, 'method: "euler"; "auto", "dopri5", "rodas4", "rk4", "ros2" are allowed'),
        ({"interpolation": "cubic"}, 'interpolation: "cubic"; "linear" or "hold" are allowed'),
        ({"step": 0.0}, "step: 0; a positive number"),
        ({"rtol": float("nan")}, "rtol: NaN; a positive number"),
        ({"rtol": float("inf")}, "rtol: inf; a finite number"),
        ({"max_steps": -1}, "max_steps: -1; at least 1"),
        ({"pressures": np.vstack([REST, REST - 1.2e5])}, "-10000 Pa.* gauge"),
    ],
)
def test_wrong_arguments(arguments: dict[str, object], text: str) -> None:
    given: dict[str, object] = {"times": [0.0, 1.0], "pressures": np.vstack([REST, REST]), **arguments}
    positional = (given.pop("times"), given.pop("pressures"))
    held = {name: given.pop(name) for name in ("forces", "interpolation") if name in given}
    with pytest.raises(bha.InputError, match=text):
        bha._core.Simulation(ARM, bha._core.Input(*positional, **held), **given)  # type: ignore[arg-type]


def test_times_must_ascend() -> None:
    simulation = bha.Simulation(ARM, smooth_input())
    with pytest.raises(bha.InputError, match="ascend"):
        simulation.advance([0.2, 0.1])
    simulation.advance([0.2])
    with pytest.raises(bha.InputError, match="not lie before"):
        simulation.advance([0.0])
