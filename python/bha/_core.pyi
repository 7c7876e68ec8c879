"""Types of the compiled core."""

from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from typing import Protocol, Self, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

from bha.errors import BhaError, SimulationError

__all__ = [
    "Arm",
    "BatchRows",
    "Controller",
    "Differentiated",
    "Differentiator",
    "DynamicsTerms",
    "Energy",
    "Fleet",
    "Input",
    "LoopRows",
    "Rest",
    "SensitivityRows",
    "Simulation",
    "SimulationRows",
    "StepCounts",
    "StepPlan",
    "Stepper",
    "Table",
    "TableColumn",
    "TextFound",
    "Variants",
    "VirtualArm",
    "VirtualRows",
    "__version__",
    "check_options",
    "closed_loop",
    "effect_kinds",
    "format_table_rows",
    "formula_fault",
    "held_poses",
    "innovations",
    "instruction_sets",
    "linear_quadratic_gain",
    "linearize",
    "moved_poses",
    "plan_steps",
    "read_table",
    "resolved_motion",
    "rest_near",
    "sensitivities",
    "simulate_batch",
]

__version__: str

class _Wrench(Protocol):
    """What :class:`bha.Wrench` is."""

    @property
    def section(self) -> int: ...
    @property
    def force(self) -> ArrayLike: ...
    @property
    def moment(self) -> ArrayLike: ...
    @property
    def fraction(self) -> float: ...
    @property
    def offset(self) -> ArrayLike: ...

class _ParameterInfo(TypedDict):
    name: str
    unit: str
    low: float
    high: float
    default: float | None
    meaning: str

class _KindInfo(TypedDict):
    kind: str
    summary: str
    places: list[str]
    parameters: list[_ParameterInfo]
    several: bool
    needs_poses: bool
    changes_arm: bool

def effect_kinds() -> list[_KindInfo]: ...
def formula_fault(text: str, names: list[str]) -> str | None: ...

@disjoint_base
class Arm:
    def __new__(cls, parameters_json: str) -> Self: ...
    def forward_kinematics(self, q: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def point_pose(
        self, q: ArrayLike, section: int, fraction: float = 1.0, offset: ArrayLike | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def jacobian(
        self, q: ArrayLike, section: int, fraction: float = 1.0, offset: ArrayLike | None = None
    ) -> NDArray[np.float64]: ...
    def shape(self, q: ArrayLike, points_per_section: int | None = None) -> NDArray[np.float64]: ...
    def configuration(self, q: ArrayLike) -> NDArray[np.float64]: ...
    def dynamics_terms(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        p: ArrayLike,
        f_ext: ArrayLike | None = None,
        wrenches: Iterable[_Wrench] | None = None,
    ) -> DynamicsTerms: ...
    def bias_force_parts(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        f_ext: ArrayLike | None = None,
        wrenches: Iterable[_Wrench] | None = None,
    ) -> dict[str, NDArray[np.float64]]: ...
    def inertia_matrix(self, q: ArrayLike) -> NDArray[np.float64]: ...
    def coriolis_matrix(self, q: ArrayLike, qd: ArrayLike) -> NDArray[np.float64]: ...
    def bias_force(
        self, q: ArrayLike, qd: ArrayLike, f_ext: ArrayLike | None = None, wrenches: Iterable[_Wrench] | None = None
    ) -> NDArray[np.float64]: ...
    def actuation_force(self, q: ArrayLike, p: ArrayLike) -> NDArray[np.float64]: ...
    def actuation_matrix(self, q: ArrayLike) -> NDArray[np.float64]: ...
    def forward_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        p: ArrayLike,
        f_ext: ArrayLike | None = None,
        wrenches: Iterable[_Wrench] | None = None,
    ) -> NDArray[np.float64]: ...
    def inverse_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        f_ext: ArrayLike | None = None,
        wrenches: Iterable[_Wrench] | None = None,
    ) -> NDArray[np.float64]: ...
    def energy(self, q: ArrayLike, qd: ArrayLike) -> Energy: ...
    def static_lengths(
        self,
        p: ArrayLike,
        f_ext: ArrayLike | None = None,
        *,
        wrenches: Iterable[_Wrench] | None = None,
        coupled: bool = True,
        start: ArrayLike | None = None,
    ) -> NDArray[np.float64]: ...

@final
class Variants:
    def __new__(cls, parameters_json: str, places: Sequence[str]) -> Self: ...
    def arm(self, values: ArrayLike) -> Arm: ...

@final
class DynamicsTerms:
    @property
    def inertia_matrix(self) -> NDArray[np.float64]: ...
    @property
    def coriolis_matrix(self) -> NDArray[np.float64]: ...
    @property
    def bias_force(self) -> NDArray[np.float64]: ...
    @property
    def actuation_force(self) -> NDArray[np.float64]: ...

@final
class Energy:
    @property
    def translational(self) -> float: ...
    @property
    def rotational(self) -> float: ...
    @property
    def gravity(self) -> float: ...
    @property
    def bending(self) -> float: ...
    @property
    def spring(self) -> float: ...
    @property
    def axial(self) -> float: ...
    @property
    def kinetic(self) -> float: ...
    @property
    def potential(self) -> float: ...
    @property
    def total(self) -> float: ...

@final
class Input:
    def __new__(
        cls,
        time: ArrayLike,
        pressures: ArrayLike,
        forces: ArrayLike | None = None,
        wrenches: Iterable[_Wrench] | None = None,
        *,
        interpolation: str = "linear",
        name: str = "",
    ) -> Self: ...

@final
class SimulationRows:
    @property
    def lengths(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64]: ...
    @property
    def pressures(self) -> NDArray[np.float64]: ...
    @property
    def head_positions(self) -> NDArray[np.float64]: ...
    @property
    def head_orientations(self) -> NDArray[np.float64]: ...
    @property
    def measured_lengths(self) -> NDArray[np.float64] | None: ...
    @property
    def measured_head_positions(self) -> NDArray[np.float64] | None: ...
    @property
    def measured_head_orientations(self) -> NDArray[np.float64] | None: ...
    @property
    def failure(self) -> SimulationError | None: ...

@final
class StepCounts:
    @property
    def steps(self) -> int: ...
    @property
    def rejected_steps(self) -> int: ...
    @property
    def evaluations(self) -> int: ...

@final
class Simulation:
    def __new__(
        cls,
        arm: Arm,
        drive: Input,
        *,
        method: str = "auto",
        step: float = 1e-3,
        rtol: float = 1e-6,
        atol: float = 1e-8,
        min_step: float = 1e-10,
        max_step: float = ...,
        max_steps: int | None = None,
        start: float | None = None,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
    ) -> Self: ...
    def advance(self, times: ArrayLike) -> SimulationRows: ...
    @property
    def method(self) -> str: ...
    @property
    def statistics(self) -> StepCounts: ...

@final
class Differentiated:
    @property
    def acceleration(self) -> NDArray[np.float64]: ...
    @property
    def rows(self) -> NDArray[np.float64]: ...

@final
class SensitivityRows:
    @property
    def states(self) -> NDArray[np.float64]: ...
    @property
    def derivatives(self) -> NDArray[np.float64]: ...

@final
class Differentiator:
    def __new__(
        cls,
        arm: Arm,
        differences: Sequence[tuple[Sequence[Arm], Sequence[float]]] = ...,
        instruction_set: str | None = None,
    ) -> Self: ...
    def __call__(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        p: ArrayLike,
        f_ext: ArrayLike | None = None,
        wrenches: Iterable[_Wrench] | None = None,
    ) -> Differentiated: ...

def sensitivities(
    arm: Arm,
    drive: Input,
    output_times: ArrayLike,
    start: float,
    state: ArrayLike,
    differences: Sequence[tuple[Sequence[Arm], Sequence[float]]],
    parameter_of: Sequence[int | None],
    directions: ArrayLike,
    *,
    method: str = "auto",
    step: float = 1e-3,
    rtol: float = 1e-6,
    atol: float = 1e-8,
    max_steps: int | None = None,
) -> SensitivityRows: ...
def check_options(
    method: str,
    step: float,
    rtol: float,
    atol: float,
    min_step: float,
    max_step: float,
    max_steps: int | None,
    interpolation: str | None,
) -> None: ...
def instruction_sets() -> list[str]: ...

@disjoint_base
class Stepper:
    def __new__(cls, arm: Arm, step: float = 1e-3, method: str = "rk4") -> Self: ...
    @property
    def _state(self) -> NDArray[np.float64]: ...
    def _resume(self, state: ArrayLike) -> None: ...
    def reset(self, p: ArrayLike, q: ArrayLike | None = None, qd: ArrayLike | None = None) -> NDArray[np.float64]: ...
    def step(self, p: ArrayLike, dt: float) -> NDArray[np.float64]: ...
    @property
    def time(self) -> float: ...
    @property
    def lengths(self) -> NDArray[np.float64]: ...
    @property
    def measured_lengths(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64]: ...
    @property
    def pressures(self) -> NDArray[np.float64]: ...

@disjoint_base
class Fleet:
    def __new__(
        cls,
        arm: Arm,
        count: int,
        q: ArrayLike,
        p: ArrayLike,
        step: float = 5e-3,
        threads: int = 0,
        method: str = "rk4",
    ) -> Self: ...
    @property
    def _state(self) -> NDArray[np.float64]: ...
    def _resume(self, state: ArrayLike) -> None: ...
    def reset(self, indices: Sequence[int], q: ArrayLike, p: ArrayLike) -> NDArray[np.float64]: ...
    def step(self, p: ArrayLike, dt: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]: ...

@final
class Controller:
    def __new__(cls, arm: Arm, parameters_json: str) -> Self: ...
    def reset(self) -> None: ...
    def step(self, lengths: ArrayLike, pressures: ArrayLike, target: ArrayLike) -> NDArray[np.float64]: ...
    @property
    def at_limit(self) -> NDArray[np.int8]: ...
    @property
    def estimate(self) -> NDArray[np.float64]: ...
    @property
    def observer_gain(self) -> NDArray[np.float64]: ...
    @property
    def observer_substeps(self) -> int: ...

@final
class LoopRows:
    @property
    def lengths(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64]: ...
    @property
    def pressures(self) -> NDArray[np.float64]: ...
    @property
    def commands(self) -> NDArray[np.float64]: ...
    @property
    def estimated_velocities(self) -> NDArray[np.float64]: ...
    @property
    def at_limit(self) -> NDArray[np.int8]: ...
    @property
    def head_positions(self) -> NDArray[np.float64]: ...
    @property
    def failure(self) -> BhaError | None: ...

def closed_loop(
    stepper: Stepper,
    controller: Controller | Callable[[float, NDArray[np.float64]], ArrayLike],
    reference: ArrayLike,
    period: float,
    *,
    length_noise: float = 0.0,
    pressure_noise: float = 0.0,
    seed: int | None = None,
    decimation: int | None = None,
) -> LoopRows: ...

@final
class StepPlan:
    @property
    def method(self) -> str: ...
    @property
    def step(self) -> float: ...

def plan_steps(arm: Arm, pressures: ArrayLike, method: str | None, step: float | None, usual: float) -> StepPlan: ...

@final
class Rest:
    @property
    def pressures(self) -> NDArray[np.float64]: ...
    @property
    def lengths(self) -> NDArray[np.float64]: ...

def rest_near(arm: Arm, q: ArrayLike, low: ArrayLike, high: ArrayLike, preferred: ArrayLike) -> Rest: ...
def resolved_motion(
    arm: Arm,
    positions: ArrayLike,
    directions: ArrayLike | None,
    start: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    offset: ArrayLike | None = None,
) -> NDArray[np.float64]: ...
def linearize(
    arm: Arm, q: ArrayLike, qd: ArrayLike, p: ArrayLike, period: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def held_poses(
    arm: Arm, pressures: ArrayLike, forces: ArrayLike | None = None, near: ArrayLike | None = None
) -> NDArray[np.float64]: ...
def moved_poses(
    arm: Arm, others: Sequence[Arm], pressures: ArrayLike, held: ArrayLike, forces: ArrayLike | None = None
) -> NDArray[np.float64]: ...
def innovations(
    transitions: ArrayLike,
    added: ArrayLike,
    kinds: Sequence[int],
    kept: ArrayLike,
    sizes: ArrayLike,
    shown: ArrayLike,
    white: ArrayLike,
    read: Sequence[bool],
    covariance: ArrayLike,
    values: ArrayLike,
) -> tuple[NDArray[np.float64], float] | None: ...
def linear_quadratic_gain(a: ArrayLike, b: ArrayLike, q: ArrayLike, r: ArrayLike) -> NDArray[np.float64]: ...

@final
class BatchRows:
    @property
    def lengths(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64] | None: ...
    @property
    def head_positions(self) -> NDArray[np.float64] | None: ...
    @property
    def head_orientations(self) -> NDArray[np.float64] | None: ...
    @property
    def failures(self) -> list[BhaError | None]: ...
    @property
    def statistics(self) -> NDArray[np.uint64]: ...

def simulate_batch(
    arms: Sequence[Arm],
    inputs: Sequence[Input],
    times: Sequence[ArrayLike],
    members: Sequence[tuple[int, int, int]],
    start: ArrayLike,
    state: ArrayLike | None = None,
    moved: ArrayLike | None = None,
    *,
    method: str = "auto",
    step: float = 1e-3,
    rtol: float = 1e-6,
    atol: float = 1e-8,
    min_step: float = 1e-10,
    max_step: float = ...,
    max_steps: int | None = None,
    velocities: bool = True,
    head_positions: bool = False,
    head_orientations: bool = False,
    measured: bool = False,
    shared_steps: bool = False,
    threads: int = 0,
    instruction_set: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> BatchRows: ...

@final
class VirtualRows:
    @property
    def lengths(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64]: ...
    @property
    def creep(self) -> NDArray[np.float64]: ...

@final
class VirtualArm:
    def __new__(
        cls,
        parameters_json: str,
        distributed: Sequence[tuple[int, float, tuple[float, float, float]]],
        creep: Sequence[tuple[float, float]],
    ) -> Self: ...
    @property
    def creep_states(self) -> int: ...
    def rest(self, p: ArrayLike, f_ext: ArrayLike | None = None) -> NDArray[np.float64]: ...
    def run(
        self,
        drive: Input,
        output_times: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike,
        creep: ArrayLike,
        step: float,
    ) -> VirtualRows: ...
    def energy(self, q: ArrayLike, qd: ArrayLike, creep: ArrayLike) -> tuple[float, float]: ...

@final
class TableColumn:
    def __new__(cls, used: str, least: float, hint: str, missing: bool, absent: str) -> Self: ...

@final
class TextFound:
    @property
    def line(self) -> int: ...
    @property
    def text(self) -> str: ...

@final
class Table:
    @property
    def columns(self) -> list[NDArray[np.float64] | TextFound | None]: ...
    @property
    def unterminated(self) -> bool: ...

def read_table(
    path: str | PathLike[str],
    plan: Callable[[list[str], list[str]], list[TableColumn]],
    progress: Callable[[float], None] | None = None,
    name: str | None = None,
    layout: tuple[str, bool, int, int] | None = None,
) -> Table: ...
def format_table_rows(columns: Sequence[ArrayLike]) -> bytes: ...
