"""Every door for numbers between Python and the core: plain real numbers are taken, all else is refused by name."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import bha
from bha import _core
from bha.arrays import floats
from bha.control import Pid, Stepper, hold
from bha.errors import ConvergenceError, InputError
from bha.experiments.virtual_arm import VirtualArm

ARM = bha.robots.load("bha_nominal")
N, M = 9, len(ARM.inputs)
Q = 0.19 + 0.001 * np.arange(N)
QD = 0.01 * np.arange(N)
P = 1.2e5 + 100.0 * np.arange(M)
F = 0.1 * np.arange(N).reshape(3, 3)
X0 = np.r_[Q, QD]
LOW, HIGH = np.full(M, 0.8e5), np.full(M, 2.0e5)
SHORT, LONG = np.full(N, 0.1), np.full(N, 0.3)
FAST = bha.Options(method="rk4", step=1e-3)


@dataclass(frozen=True)
class Door:
    """One argument of one call: its name in errors, right values, and the call with others in their place."""

    call: str
    name: str
    good: Any
    result: Callable[[Any], Any]

    @property
    def id(self) -> str:
        return f"{self.call}-{self.name}"


def _controller() -> _core.Controller:
    return Pid(ARM).build(1e-3)


def _fleet() -> _core.Fleet:
    return _core.Fleet(ARM, 2, Q, P, threads=1)


def _stepped(p: Any) -> Any:
    stepper = Stepper(ARM, 1e-3)
    stepper.reset(P)
    return stepper.step(p, 2e-3)


def _simulated(drive: bha.Input, **options: Any) -> Any:
    return bha.simulate(ARM, drive, dt=5e-3, options=FAST, **options).lengths


def _closed(reference: Any) -> Any:
    stepper = Stepper(ARM, 1e-3)
    stepper.reset(P)
    return _core.closed_loop(stepper, _controller(), reference, 1e-3).lengths


def _virtual() -> _core.VirtualArm:
    return VirtualArm(ARM)._core


def _virtual_run(**changed: Any) -> Any:
    core = _virtual()
    values = {
        "time": np.array([0.0, 0.01]),
        "pressures": np.vstack([P, P]),
        "forces": None,
        "output_times": np.array([0.0, 0.005]),
        "q": core.rest(P),
        "qd": np.zeros(N),
        "creep": np.zeros(core.creep_states),
    }
    values |= changed
    drive = _core.Input(values.pop("time"), values.pop("pressures"), values.pop("forces"))
    return core.run(drive, **values, step=1e-3).lengths


def _doors() -> Iterator[Door]:
    one_state = {
        "configuration": ARM.configuration,
        "inertia_matrix": ARM.inertia_matrix,
        "actuation_matrix": ARM.actuation_matrix,
        "point_pose": lambda q: ARM.point_pose(q, 2, 0.5),
        "jacobian": lambda q: ARM.jacobian(q, 2, 0.5),
        "forward_kinematics": ARM.forward_kinematics,
        "shape": lambda q: ARM.shape(q, 3),
    }
    for call, function in one_state.items():
        yield Door(call, "q", Q, function)
    rows = np.vstack([Q, Q + 0.01])
    yield Door("forward_kinematics of rows", "q", rows, ARM.forward_kinematics)
    yield Door("shape of rows", "q", rows, lambda q: ARM.shape(q, 3))
    several: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
        "coriolis_matrix": (ARM.coriolis_matrix, {"q": Q, "qd": QD}),
        "bias_force": (ARM.bias_force, {"q": Q, "qd": QD, "f_ext": F}),
        "bias_force_parts": (lambda **a: list(ARM.bias_force_parts(**a).values()), {"q": Q, "qd": QD, "f_ext": F}),
        "dynamics_terms": (
            lambda **a: ARM.dynamics_terms(**a).bias_force,
            {"q": Q, "qd": QD, "p": P, "f_ext": F},
        ),
        "actuation_force": (ARM.actuation_force, {"q": Q, "p": P}),
        "forward_dynamics": (ARM.forward_dynamics, {"q": Q, "qd": QD, "p": P, "f_ext": F}),
        "inverse_dynamics": (ARM.inverse_dynamics, {"q": Q, "qd": QD, "qdd": QD, "f_ext": F}),
        "energy": (lambda **a: ARM.energy(**a).total, {"q": Q, "qd": QD}),
        "static_lengths": (ARM.static_lengths, {"p": P, "f_ext": F, "start": Q}),
        "linearize": (ARM.linearize, {"q": Q, "qd": QD, "p": P}),
        "forward_dynamics_derivatives": (
            lambda **a: ARM.forward_dynamics_derivatives(**a).by_lengths,
            {"q": Q, "qd": QD, "p": P, "f_ext": F},
        ),
        "Stepper.reset": (lambda **a: Stepper(ARM, 1e-3).reset(**a), {"p": P, "q": Q, "qd": QD}),
        "Fleet": (
            lambda **a: _core.Fleet(ARM, 2, **a, threads=1).reset([], np.zeros((0, N)), np.zeros((0, M))),
            {"q": Q, "p": P},
        ),
        "Fleet.reset": (
            lambda **a: _fleet().reset([0, 1], **a),
            {"q": np.vstack([Q, Q]), "p": np.vstack([P, P])},
        ),
        "Controller.step": (
            lambda **a: _controller().step(**a),
            {"lengths": Q, "pressures": P, "target": np.vstack([Q, QD, QD])},
        ),
        "rest_near": (
            lambda **a: _core.rest_near(ARM, **a).lengths,
            {"q": Q, "low": LOW, "high": HIGH, "preferred": P},
        ),
        "resolved_motion": (
            lambda **a: _core.resolved_motion(ARM, **a),
            {
                "positions": np.tile(ARM.forward_kinematics(Q)[0][-1], (2, 1)),
                "directions": None,
                "start": Q,
                "low": SHORT,
                "high": LONG,
            },
        ),
        "linear_quadratic_gain": (
            _core.linear_quadratic_gain,
            {"a": 0.9 * np.eye(3), "b": np.eye(3)[:, :2], "q": np.eye(3), "r": np.eye(2)},
        ),
        "VirtualArm.rest": (lambda **a: _virtual().rest(**a), {"p": P, "f_ext": F}),
        "VirtualArm.energy": (
            lambda **a: _virtual().energy(**a),
            {"q": Q, "qd": QD, "creep": np.zeros(_virtual().creep_states)},
        ),
    }
    for call, (function, arguments) in several.items():
        for name, good in arguments.items():
            if good is not None:
                yield Door(call, name, good, lambda x, f=function, a=arguments, n=name: f(**{**a, n: x}))
    for name, good in {
        "time": [0.0, 0.01],
        "pressures": [P, P],
        "output_times": [0.0, 0.005],
        "q": Q,
        "qd": QD,
    }.items():
        yield Door("VirtualArm.run", name, np.array(good), lambda x, n=name: _virtual_run(**{n: x}))
    yield Door("Stepper.step", "p", P, _stepped)
    yield Door("Fleet.step", "p", np.vstack([P, P]), lambda p: _fleet().step(p, 5e-3)[0])
    yield Door("closed_loop", "reference", np.tile(np.r_[Q, QD, QD], (3, 1)), _closed)
    yield Door("hold", "lengths", Q, lambda q: hold(q, 0.002).lengths)
    time, rows = np.array([0.0, 0.01]), np.vstack([P, P])
    drive = bha.Input(time, rows)
    yield Door("simulate", "q", Q, lambda q: _simulated(drive, q0=q))
    yield Door("simulate", "qd", QD, lambda qd: _simulated(drive, q0=Q, qd0=qd))
    yield Door("Input", "time", time, lambda t: _simulated(bha.Input(t, rows)))
    yield Door("Input", "pressures", rows, lambda p: _simulated(bha.Input(time, p)))
    yield Door("Input.constant", "pressures", P, lambda p: _simulated(bha.Input.constant(p, 0.01)))
    yield Door("simulate_batch", "x0", X0, lambda x: bha.simulate_batch(ARM, drive, x, times=time).lengths)
    yield Door("simulate_batch", "times", time, lambda t: bha.simulate_batch(ARM, drive, X0, times=t).lengths)
    yield Door(
        "sensitivities", "x0", X0, lambda x: bha.sensitivities(ARM, drive, x, times=time, initial_state=False).states
    )
    yield Door(
        "sensitivities", "times", time, lambda t: bha.sensitivities(ARM, drive, X0, times=t, initial_state=False).states
    )
    yield Door("format_table_rows", "columns[0]", Q, lambda c: np.frombuffer(_core.format_table_rows([c]), np.uint8))


DOORS = list(_doors())
PRESSURES = {"p", "pressures"}


def _unaligned(x: np.ndarray) -> np.ndarray:
    """As a field of a packed record has it."""
    record = np.zeros(1, np.dtype([("status", "u1"), ("x", "<f8", x.shape)]))
    record["x"] = x
    field: np.ndarray = np.frombuffer(record.tobytes(), record.dtype)["x"][0]
    assert not field.flags.aligned
    return field


def _strided(x: np.ndarray) -> np.ndarray:
    wide = np.zeros((*x.shape[:-1], 2 * x.shape[-1]))
    wide[..., ::2] = x
    return wide[..., ::2]


def _reversed(x: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(x[..., ::-1])[..., ::-1]


def _read_only(x: np.ndarray) -> np.ndarray:
    copy = x.copy()
    copy.flags.writeable = False
    return copy


TAKEN: dict[str, Callable[[np.ndarray], Any]] = {
    "list": lambda x: x.tolist(),
    "tuple": lambda x: tuple(x.tolist()),
    "strided": _strided,
    "reversed": _reversed,
    "column by column": np.asfortranarray,
    "big-endian": lambda x: x.astype(">f8"),
    "read-only": _read_only,
    "unaligned": _unaligned,
    "nothing masked": lambda x: np.ma.masked_array(x, mask=False),
    "longer floats": lambda x: x.astype(np.longdouble),
}


def _with(x: np.ndarray, value: float) -> np.ndarray:
    changed = x.copy()
    changed.flat[-1] = value
    return changed


def _masked(x: np.ndarray) -> Any:
    mask = np.zeros(x.shape, bool)
    mask.flat[-1] = True
    return np.ma.masked_array(x, mask=mask)


REFUSED: dict[str, Callable[[np.ndarray], Any]] = {
    "one more": lambda x: np.concatenate([x, x[..., -1:]], axis=-1)[..., None],
    "a dimension more": lambda x: x[None, None],
    "a number": lambda _: 1.0,
    "empty": lambda _: np.zeros(()),
    "NaN": lambda x: _with(x, np.nan),
    "infinite": lambda x: _with(x, np.inf),
    "masked": _masked,
    "a list of masked": lambda x: list(_masked(np.atleast_2d(x))),
    "complex": lambda x: x + 1j,
    "dates": lambda x: np.zeros(x.shape, "datetime64[s]"),
    "spans": lambda x: np.zeros(x.shape, "timedelta64[s]"),
    "text": lambda x: x.astype(str),
    "bytes": lambda x: x.astype("S"),
    "objects": lambda x: x.astype(object),
    "truth values": lambda x: x > 0,
    "ragged": lambda x: [[1.0], [1.0, 2.0], *x.tolist()],
    "none": lambda x: np.full(x.shape, None),
    "a mapping": lambda x: {"values": x},
    "a set": lambda x: {1.0},
    "text itself": lambda _: "0.19",
    "its own conversion fails": lambda _: _Broken(),
}
#: Columns of tables may hold anything that is a number; NaN at the end of a member's times says that it has fewer.
NOT_REFUSED = {
    ("format_table_rows-columns[0]", "NaN"),
    ("format_table_rows-columns[0]", "infinite"),
    ("simulate_batch-times", "NaN"),
    ("simulate_batch-times", "one more"),  # three members with a row each
}


class _Broken:
    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        raise ZeroDivisionError("nothing in here")


def _flat(result: Any) -> np.ndarray:
    if isinstance(result, tuple | list):
        return np.concatenate([_flat(part) for part in result])
    return np.asarray(result, dtype=np.float64).reshape(-1)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.id)
def test_any_layout_of_plain_numbers_is_taken(door: Door) -> None:
    expected = _flat(door.result(door.good))
    assert np.isfinite(expected).all()
    for kind, change in TAKEN.items():
        np.testing.assert_array_equal(_flat(door.result(change(door.good))), expected, err_msg=kind)
    single = door.good.astype(np.float32)
    np.testing.assert_array_equal(_flat(door.result(single)), _flat(door.result(single.astype(float))))


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.id)
def test_what_is_no_plain_number_is_refused_by_name(door: Door) -> None:
    for kind, change in REFUSED.items():
        if (door.id, kind) in NOT_REFUSED:
            continue
        with pytest.raises(InputError) as caught:
            door.result(change(door.good))
        assert door.name in str(caught.value), (kind, str(caught.value))


@pytest.mark.parametrize("door", [d for d in DOORS if d.name in PRESSURES], ids=lambda door: door.id)
def test_negative_absolute_pressures_ask_whether_they_are_gauge(door: Door) -> None:
    with pytest.raises(InputError, match=rf"{door.name}: element {door.good.size - 1} is -20000 Pa; .*gauge"):
        door.result(_with(door.good, -2e4))


def test_what_is_masked_or_no_number_is_said() -> None:
    with pytest.raises(InputError, match="q: some of its values are masked"):
        ARM.forward_kinematics(_masked(Q))
    with pytest.raises(
        InputError, match=r"q: an array of floats of shape \(9,\) is needed; found dates \(dtype datetime"
    ):
        ARM.energy(np.zeros(9, "datetime64[s]"), QD)
    with pytest.raises(InputError, match=r"q: expected shape \(9,\) or \(any, 9\), found \[8\]"):
        ARM.forward_kinematics(Q[:8])
    with pytest.raises(InputError, match="nothing in here"):
        ARM.forward_kinematics(_Broken())
    assert floats(Q, "q") is Q
    with pytest.raises(InputError, match="x: NaN; a finite number is needed"):
        floats(np.nan, "x", ())


def test_numbers_beyond_the_model_are_no_quiet_answer() -> None:
    """Finite arguments whose results are not: an error that names what is not finite."""
    huge = np.full(N, 1e308)
    for name, call in {
        "acceleration": lambda: ARM.forward_dynamics(Q, huge, P),
        "energy": lambda: ARM.energy(huge, QD),
        "bias_force": lambda: ARM.bias_force(huge, QD),
    }.items():
        with pytest.raises(InputError, match=f"{name}: not finite"):
            call()
    with pytest.raises(InputError, match="states of the plants: not finite"):
        _fleet().reset([0], 1e10 * Q[None], P[None])


def test_whole_numbers_and_offsets_are_checked_by_name() -> None:
    for wrong in (0, 4, -1, 10**30, 1.0, "2", None, np.array([1])):
        with pytest.raises(InputError, match=r"section: .*; whole numbers from 1 to 3 are allowed"):
            ARM.jacobian(Q, wrong)  # type: ignore[arg-type]
    for wrong in (0, -1, 10**30, "2", 1.5):
        with pytest.raises(InputError, match=r"points_per_section: .*; whole numbers from 1 to 333333"):
            ARM.shape(Q, wrong)  # type: ignore[arg-type]
    np.testing.assert_array_equal(ARM.jacobian(Q, np.int64(2)), ARM.jacobian(Q, 2))
    for offset in ([0.0, 0.0], [0.0, 0.0, np.nan], ["a"] * 3, 1.0):
        with pytest.raises(InputError, match="offset: "):
            ARM.point_pose(Q, 1, 0.5, offset)
    with pytest.raises(InputError, match=r"seed: -1; whole numbers from 0"):
        _core.closed_loop(Stepper(ARM, 1e-3), _controller(), np.zeros((1, 3 * N)), 1e-3, seed=-1)


def test_what_is_no_arm_is_said() -> None:
    for call, text in {
        lambda: bha.Arm("arm.toml"): "parameters: str; ArmParameters are needed",  # type: ignore[arg-type]
        lambda: ARM.with_changes(gravity="down"): "gravity: an array of floats",
        lambda: ARM.with_changes(gravity=(0.0, 9.81)): "gravity: expected shape",
        lambda: ARM.with_effects("creep"): "effects: a list",  # type: ignore[arg-type]
        lambda: ARM.with_effects([5]): "effects: a list",  # type: ignore[list-item]
    }.items():
        with pytest.raises(InputError, match=text):
            call()


def test_static_lengths_that_are_none() -> None:
    """A vacuum pulls the nominal arm through its base: no rest, and the pressures are asked about."""
    for pressure in (0.0, 2e4):
        for coupled in (True, False):
            with pytest.raises(ConvergenceError, match=r"section 1: its mean length at rest would be -0.*gauge"):
                ARM.static_lengths(np.full(M, pressure), coupled=coupled)
    psi = bha.Input(np.array([0.0, 1.0]), np.zeros((2, M)))
    with pytest.raises(ConvergenceError, match="gauge"):
        bha.simulate(ARM, psi)
    assert ARM.static_lengths(np.full(M, 7e4)).min() > 0.05


def test_kinematics_of_many_states_are_those_of_each() -> None:
    rows = 0.19 + 0.02 * np.random.default_rng(1).standard_normal((50, N))
    for arm in (ARM, ARM.with_effects([{"kind": "torsion", "where": "section 2", "stiffness": 3.0}])):
        positions, rotations = arm.forward_kinematics(rows)
        points = arm.shape(rows, 4)
        assert positions.shape == (50, 3, 3)
        assert rotations.shape == (50, 3, 3, 3)
        for k, q in enumerate(rows):
            single, turned = arm.forward_kinematics(q)
            np.testing.assert_array_equal(positions[k], single)
            np.testing.assert_array_equal(rotations[k], turned)
            np.testing.assert_array_equal(points[k], arm.shape(q, 4))
    assert ARM.forward_kinematics(np.zeros((0, N)))[0].shape == (0, 3, 3)
    assert ARM.shape(np.zeros((0, N)), 4).shape == (0, *points.shape[1:])


def test_absurd_sizes_are_errors_at_once() -> None:
    with pytest.raises(
        InputError, match="points_per_section: 1000000000000000; whole numbers from 1 to 333333 are allowed"
    ):
        ARM.shape(Q, 10**15)
    with pytest.raises(InputError, match="count: 10000000000; 1 to 1048576 environments"):
        _core.Fleet(ARM, 10**10, Q, P)
    with pytest.raises(InputError, match=r"2e\+10 rows of members; fewer at a time are needed"):
        bha.simulate_batch([ARM] * 20_000, bha.Input.constant(P, 1.0), X0, times=np.linspace(0, 1, 1_000_000))
    mapping = ARM.parameters.to_mapping()
    mapping["section"] *= 270
    with pytest.raises(bha.ParameterError, match=r"section: found a list of 810 tables; .* at most 256"):
        bha.parameters.ArmParameters.from_mapping(mapping)
    core = json.loads(ARM.parameters.to_core_json())
    core["section"] *= 270
    with pytest.raises(bha.ParameterError, match="number of sections = 810; 1 to 256 are allowed"):
        _core.Arm(json.dumps(core))


def test_a_plant_is_not_stepped_by_the_controller_that_it_asks() -> None:
    stepper = Stepper(ARM, 1e-3)
    stepper.reset(P)
    with pytest.raises(InputError, match="this stepper is in use by the call that this call comes from"):
        _core.closed_loop(stepper, lambda t, y: stepper.step(P, 1e-3)[-M:], np.tile(np.r_[Q, QD, QD], (3, 1)), 1e-3)
    assert stepper.step(P, 1e-3).shape == (N + M,)
