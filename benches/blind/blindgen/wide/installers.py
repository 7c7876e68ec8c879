"""How each hidden effect of the wide world is drawn (``draw_*``: its shape) and put into the true arm (``put_*``).

Amplitudes are relative to the arm where that makes sense; what comes back are the numbers for the sealed answer, in SI.
Which kinds there are and how strong they may be stands in :mod:`.hidden`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import hidden as h
from . import bellows as b
from .arms import GRAVITY, TrueArm
from .truth import Truth

Array = NDArray[np.float64]
Shape = dict[str, Any]
Numbers = dict[str, float]


@dataclass(frozen=True)
class Context:
    """What drawing may look at: the arm, the heads of the plain arm in a typical run (samples, n, 3), the section."""

    arm: TrueArm
    heads: Array
    section: int


def _bellows(arm: TrueArm, where: str) -> list[int]:
    """Bellows (from 0, along the arm) that a place names."""
    owners = [(i, k) for i, s in enumerate(arm.sections) for k in range(len(s.bellows))]
    if where == "all":
        return list(range(len(owners)))
    word, name = where.split()
    if word == "section":
        return [j for j, (i, _) in enumerate(owners) if i == int(name) - 1]
    return [owners.index((int(name[0]) - 1, int(name[1]) - 1))]


def _sections(arm: TrueArm, where: str) -> list[int]:
    return list(range(len(arm.sections))) if where == "all" else [int(where.split()[1]) - 1]


def _inputs(arm: TrueArm, where: str) -> list[int]:
    if where == "all":
        return list(range(len(arm.inputs)))
    word, name = where.split()
    if word == "input":
        return [arm.inputs.index(name)]
    return [j for j, x in enumerate(arm.inputs) if x[1] == name]


def _full_force(arm: TrueArm, j: int) -> float:
    """Force of the springs of bellows ``j`` at a third of its rest length, N."""
    s = [s for s in arm.sections for _ in s.bellows][j]
    return s.stiffness[0] * 0.33 * s.rest_length


def _own_bending(arm: TrueArm, i: int) -> float:
    s = arm.sections[i]
    return 0.5 * len(s.bellows) * s.radius**2 * s.stiffness[0] + s.bending[0]


def _span(arm: TrueArm, j: int) -> float:
    """Range of pressures of input ``j``, Pa."""
    s = arm.sections[int(arm.inputs[j][1]) - 1]
    return s.pressure_range[1] - s.pressure_range[0]


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_nothing(rng: np.random.Generator, context: Context) -> Shape:
    return {}


def draw_sign(rng: np.random.Generator, context: Context) -> Shape:
    return {"sign": 1.0 if rng.random() < 0.5 else -1.0}


def draw_creep(rng: np.random.Generator, context: Context) -> Shape:
    first = _log_uniform(rng, 0.1, 1.2)
    second = first * rng.uniform(2.0, 5.0)
    shares = rng.dirichlet([2.0, 2.0, 2.0])
    return {"tau": [first, second, second * rng.uniform(2.0, 5.0)], "shares": [float(x) for x in shares]}


def creep(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    total = 0.0
    for j in _bellows(arm, where):
        row = truth.arm.table[j]
        total = amplitude * row[b.B_STIFFNESS]
        row[b.B_CREEP : b.B_CREEP + 3] = total * np.array(shape["shares"])
        row[b.B_CREEP + 3 : b.B_CREEP + 6] = shape["tau"]
    return {"stiffness_sum": float(total)}


def hysteresis(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    force = 0.0
    for j in _bellows(arm, where):
        force = amplitude * _full_force(arm, j)
        truth.arm.table[j, b.B_SLIP : b.B_SLIP + 2] = force, shape["yield"]
    return {"force": force}


def draw_friction(rng: np.random.Generator, context: Context) -> Shape:
    return {
        "break_ratio": float(rng.uniform(1.0, 1.4)),
        "stribeck_speed": float(rng.uniform(3e-3, 15e-3)),
        "presliding": float(rng.uniform(0.2e-3, 0.5e-3)),
    }


def friction(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    force = 0.0
    for j in _bellows(arm, where):
        force = amplitude * _full_force(arm, j)
        truth.arm.table[j, b.B_BRISTLE : b.B_BRISTLE + 5] = (
            force, force * shape["break_ratio"], shape["stribeck_speed"], shape["presliding"], 0.5,
        )  # fmt: skip
    return {"force": force}


def power(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    factor = 0.0
    for j in _bellows(arm, where):
        speed = 0.5 * truth.arm.table[j, b.B_REST]
        factor = amplitude * _full_force(arm, j) / speed ** shape["exponent"]
        truth.arm.table[j, b.B_POWER : b.B_POWER + 2] = factor, shape["exponent"]
    return {"factor": float(factor)}


def bending_damping(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    value = 0.0
    for i in _sections(arm, where):
        s = arm.sections[i]
        value = amplitude * 0.5 * len(s.bellows) * s.radius**2 * s.damping
        truth.arm.hidden.sections[i, h.S_BENDING_DAMPING : h.S_BENDING_DAMPING + 2] = value, 0.2
    return {"damping": value}


def bending_nonlinear(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    value = 0.0
    for i in _sections(arm, where):
        value = amplitude * _own_bending(arm, i)
        truth.arm.hidden.sections[i, h.S_BENDING_EXPONENTIAL : h.S_BENDING_EXPONENTIAL + 2] = value, shape["scale"]
    return {"moment": value}


def coupling(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    value = 0.0
    for i in range(len(arm.sections) - 1) if where == "all" else _sections(arm, where):
        value = amplitude * _own_bending(arm, i)
        truth.arm.hidden.sections[i, h.S_COUPLING : h.S_COUPLING + 2] = value, 0.02 * value
    return {"stiffness": value}


def draw_area(rng: np.random.Generator, context: Context) -> Shape:
    variant = "pressure" if rng.random() < 0.5 else "length"
    return {"variant": variant, **draw_sign(rng, context), "scale": float(rng.uniform(0.4, 0.9))}


def area(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    value = shape["sign"] * amplitude
    for j in _bellows(arm, where):
        row = truth.arm.table[j]
        if shape["variant"] == "pressure":
            row[b.B_TANH : b.B_TANH + 2] = value, shape["scale"] * _span(arm, int(row[b.B_INPUT]))
        else:
            row[b.B_SLOPE] = value / (0.33 * row[b.B_REST])
    return {"relative": value}


def draw_weak(rng: np.random.Generator, context: Context) -> Shape:
    return {"sign": 1.0 if rng.random() < 0.7 else -1.0, "slope": float(rng.uniform(-2.0, 2.0))}


def weak(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    for j in _bellows(arm, where):
        truth.arm.table[j, b.B_WEAK : b.B_WEAK + 2] = shape["sign"] * amplitude, shape["slope"]
    return {"loss": shape["sign"] * amplitude}


def draw_payload(rng: np.random.Generator, context: Context) -> Shape:
    angle, side = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 0.4) * context.arm.sections[context.section].radius
    return {"x": float(side * np.cos(angle)), "y": float(side * np.sin(angle)), "z": float(rng.uniform(0.01, 0.05))}


def payload(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    mass = 0.0
    for i in _sections(arm, where):
        mass = amplitude * arm.sections[i].mass
        truth.arm.hidden.sections[i, h.S_PAYLOAD : h.S_PAYLOAD + 4] = mass, shape["x"], shape["y"], shape["z"]
    return {"mass": mass}


def draw_direction(rng: np.random.Generator, context: Context) -> Shape:
    return {"direction": float(rng.uniform(0.0, 2.0 * np.pi))}


def tilt(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    g = np.array(arm.gravity)
    axis = np.array([np.cos(shape["direction"]), np.sin(shape["direction"]), 0.0])
    c, s = np.cos(amplitude), np.sin(amplitude)
    truth.arm.hidden.whole[:3] = g * c + np.cross(axis, g) * s + axis * (axis @ g) * (1.0 - c)
    return {"angle": amplitude}


def draw_tool(rng: np.random.Generator, context: Context) -> Shape:
    place = np.mean(context.heads[:, -1], axis=0)
    away = rng.normal(size=3) * 0.3 * float(np.linalg.norm(place))
    anchor = place + away
    return {
        "anchor": [float(x) for x in anchor],
        "damping_time": float(rng.uniform(0.02, 0.1)),
        "air": float(rng.uniform(0.02, 0.2)),
    }


def tool(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    i = len(arm.sections) - 1
    stiffness = amplitude * _own_bending(arm, i) / arm.sections[i].rest_length ** 2
    truth.arm.hidden.whole[h.W_TOOL : h.W_TOOL + 6] = (
        *shape["anchor"], stiffness, stiffness * shape["damping_time"], shape["air"],
    )  # fmt: skip
    return {"stiffness": stiffness}


def draw_contact(rng: np.random.Generator, context: Context) -> Shape:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    normal = np.array([np.cos(angle), np.sin(angle), 0.0])
    reach = context.heads[:, context.section] @ normal
    return {
        "normal": [float(x) for x in normal],
        "offset": float(np.quantile(reach, rng.uniform(0.70, 0.88))),
        "damping": float(rng.uniform(0.3, 1.5)),
    }


def contact(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    value = 0.0
    for i in _sections(arm, where):
        lateral = _own_bending(arm, i) / arm.sections[i].rest_length ** 2
        value = amplitude * lateral / np.sqrt(5e-3)
        truth.arm.hidden.sections[i, h.S_CONTACT : h.S_CONTACT + 6] = (
            *shape["normal"], shape["offset"], value, shape["damping"],
        )  # fmt: skip
    return {"hertz_stiffness": float(value)}


def draw_lag(rng: np.random.Generator, context: Context) -> Shape:
    return {"vent_ratio": float(rng.choice([1.0, -1.0]) * rng.uniform(0.3, 1.0)), "power": float(rng.uniform(0.8, 2.0))}


def lag(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    vent = amplitude * float(np.exp(shape["vent_ratio"]))
    for j in _inputs(arm, where):
        truth.lag.fill[j], truth.lag.vent[j], truth.lag.power[j] = amplitude, vent, shape["power"]
    return {"tau_fill": amplitude, "tau_vent": vent}


def draw_delay(rng: np.random.Generator, context: Context) -> Shape:
    return {"variant": "inputs" if rng.random() < 0.6 else "sensors"}


def delay(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    if shape["variant"] == "inputs":
        truth.path.delay[_inputs(arm, where)] = amplitude
    else:
        truth.reading.delay = amplitude
    return {"delay": amplitude}


def band(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    value = 0.0
    for j in _inputs(arm, where):
        value = amplitude * _span(arm, j)
        truth.path.band[j] = value
    return {"band": value}


def pressure_offset(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    (j,) = _inputs(arm, where)
    truth.path.offset[j] = shape["sign"] * amplitude * _span(arm, j)
    return {"offset": float(truth.path.offset[j])}


def pressure_gain(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    (j,) = _inputs(arm, where)
    truth.path.gain[j] = shape["sign"] * amplitude
    return {"gain": shape["sign"] * amplitude}


def _sensor(where: str) -> int:
    name = where.split()[1]
    return 3 * (int(name[0]) - 1) + int(name[1]) - 1


def length_offset(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    j = _sensor(where)
    truth.reading.offset[j] = shape["sign"] * amplitude * arm.sections[j // 3].rest_length
    return {"offset": float(truth.reading.offset[j])}


def length_gain(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    truth.reading.gain[_sensor(where)] = shape["sign"] * amplitude
    return {"gain": shape["sign"] * amplitude}


def torsion(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    value = 0.0
    for i in _sections(arm, where):
        value = shape["sign"] * amplitude / (0.33 * arm.sections[i].rest_length)
        truth.arm.hidden.sections[i, h.S_TORSION] = value
    return {"twist_per_length": value}


def curvature(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    for i in _sections(arm, where):
        truth.arm.hidden.sections[i, h.S_SPLIT] = 0.5 * (1.0 + shape["sign"] * amplitude)
    return {"imbalance": shape["sign"] * amplitude}


def other_model(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    truth.arm = truth.arm._replace(end_force=not truth.arm.end_force)
    return {}


def one_sided(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    for j in _bellows(arm, where):
        truth.arm.table[j, b.B_ONE_SIDED] = amplitude * truth.arm.table[j, b.B_DAMPING]
    return {"relative": amplitude}


def draw_sag(rng: np.random.Generator, context: Context) -> Shape:
    return {"time": _log_uniform(rng, 0.1, 1.0)}


def sag(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    truth.path.sag, truth.path.sag_time = amplitude, shape["time"]
    return {"share": amplitude}


def draw_drift(rng: np.random.Generator, context: Context) -> Shape:
    return {**draw_sign(rng, context), "time": float(rng.uniform(20.0, 90.0))}


def drift(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    for j in _bellows(arm, where):
        truth.arm.table[j, b.B_DRIFT : b.B_DRIFT + 2] = shape["sign"] * amplitude, shape["time"]
    return {"relative": shape["sign"] * amplitude}


def draw_periodic(rng: np.random.Generator, context: Context) -> Shape:
    return {
        "frequency": _log_uniform(rng, 0.3, 5.0),
        "phase": float(rng.uniform(0.0, 2.0 * np.pi)),
        "direction": float(rng.uniform(0.0, 2.0 * np.pi)),
    }


def periodic(truth: Truth, arm: TrueArm, where: str, shape: Shape, amplitude: float) -> Numbers:
    force = 0.0
    for i in _sections(arm, where):
        force = amplitude * GRAVITY * arm.sections[i].mass
        truth.arm.hidden.sections[i, h.S_PERIODIC : h.S_PERIODIC + 4] = (
            force, shape["frequency"], shape["phase"], shape["direction"],
        )  # fmt: skip
    return {"force": force}


def draw_yield(rng: np.random.Generator, context: Context) -> Shape:
    return {"yield": _log_uniform(rng, 0.008, 0.06) * context.arm.sections[context.section].rest_length}
