"""The arm: what a parameter file says, and the model computed from it by the core."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arm.derivatives import Derivatives, differentiator, linearized
from bha.arm.wrench import Wrench
from bha.arrays import floats
from bha.errors import InputError
from bha.parameters import ArmParameters, EffectParameters, ForceModel, PneumaticsLevel, paths
from bha.support.shown import html_table, span

_Arm = TypeVar("_Arm", bound="Arm")


class Arm(_core.Arm):
    """An arm, immutable. The numerical methods are those of the core and are inherited as they are.

    Create one with :meth:`load`, :func:`bha.robots.load` or :meth:`from_parameters`.
    """

    __slots__ = ("_differentiators", "_parameters")
    _parameters: ArmParameters
    _differentiators: dict[tuple[str, ...], Callable[..., Derivatives]]

    def __new__(cls, parameters: ArmParameters) -> Self:
        """Build the model of ``parameters``; the same as :meth:`from_parameters`."""
        if not isinstance(parameters, ArmParameters):
            found = type(parameters).__name__
            raise InputError(f"parameters: {found}; ArmParameters are needed (Arm.load reads a file)")
        self = super().__new__(cls, parameters.to_core_json())
        self._parameters = parameters
        self._differentiators = {}
        return self

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a parameter file (TOML, schema ``bha-arm/1``).

        Raises:
            ParameterError: the file is missing or not valid; the text names file, line, key, what was
                found and what is allowed.
        """
        return cls(ArmParameters.read(path))

    @classmethod
    def from_parameters(cls, parameters: ArmParameters) -> Self:
        """The arm of given parameters."""
        return cls(parameters)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the parameter file, whole or not at all, with provenance; comments of the file it came from are kept.

        Raises:
            InputError: the folder does not exist.
        """
        self._parameters.write(path)

    @property
    def parameters(self) -> ArmParameters:
        """Everything the parameter file says, with where each value comes from."""
        return self._parameters

    @property
    def name(self) -> str:
        """Name of the arm."""
        return self._parameters.name

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the pressure inputs, in the order in which every pressure vector has them."""
        return self._parameters.inputs

    @property
    def pneumatics_level(self) -> PneumaticsLevel:
        """How much lies between commanded and acting pressure: ``"ideal"`` (nothing), ``"lag"`` or ``"full"``."""
        table = self._parameters.pneumatics
        return "ideal" if table is None else table.level

    @property
    def section_count(self) -> int:
        """Number of sections, n; the coordinates are 3n."""
        return len(self._parameters.sections)

    def with_changes(
        self,
        *,
        name: str | None = None,
        gravity: Sequence[float] | None = None,
        ambient_pressure: float | None = None,
        force_model: ForceModel | None = None,
        rotational_energy: bool | None = None,
        coriolis_forces: bool | None = None,
        pneumatics: PneumaticsLevel | None = None,
    ) -> Self:
        """A new arm with some of the values and switches of the whole arm changed; what is None stays.

        ``pneumatics`` is the level of the ``[pneumatics]`` table, ``"ideal"``, ``"lag"`` or ``"full"``.

        Raises:
            ParameterError: a value that is not allowed.
            InputError: ``gravity`` is not three numbers.
        """
        changes: dict[str, Any] = {
            "name": name,
            "gravity": None if gravity is None else floats(gravity, "gravity", (3,)).tolist(),
            "ambient_pressure": ambient_pressure,
            "force_model": force_model,
            "rotational_energy": rotational_energy,
            "coriolis_forces": coriolis_forces,
        }
        if pneumatics is not None and (self.pneumatics_level, pneumatics) != ("ideal", "ideal"):
            table = self._parameters.to_mapping().get("pneumatics", {})
            changes["pneumatics"] = {**table, "level": pneumatics}
        changes = {key: value for key, value in changes.items() if value is not None}
        return self.with_parameters(self._parameters.updated(changes))

    def with_parameters(self, parameters: ArmParameters) -> Self:
        """A new arm of these parameters, of the same class and with the attributes that a subclass has given it."""
        arm = _built(type(self), parameters)
        restore = getattr(arm, "__setstate__", None)
        state = self.__getstate__()
        if restore is not None:
            restore(state)
        elif isinstance(state, tuple):
            for name, value in {**(state[0] or {}), **(state[1] or {})}.items():
                setattr(arm, name, value)
        return arm

    def with_values(self, values: Mapping[str, float]) -> Self:
        """A new arm with the numbers at some paths changed: ``arm.with_values({"section.1.mass": 0.8})``.

        Args:
            values: numbers by path, as :mod:`bha.parameters.paths` and ``bha identify --free`` name them. A pattern
                stands for all numbers that it matches (``section.*.mass``); of two that name the same number the later
                one counts. A changed value loses its provenance, which was that of another value, and so counts as
                assumed.

        Raises:
            ParameterError: there is no such number (the text names the nearest), or the value is not allowed there.
            InputError: something that is no finite number.
        """
        return self.with_parameters(paths.restated(self._parameters, values))

    def with_effects(self, effects: Sequence[EffectParameters | Mapping[str, Any]]) -> Self:
        """A new arm with these effects in place of its own ones; ``[]`` takes all away.

        Args:
            effects: :class:`bha.parameters.EffectParameters`, or mappings with the keys of an ``[[effect]]`` table.
                To add one: ``arm.with_effects([*arm.parameters.effects, {"kind": "creep", ...}])``.

        Raises:
            ParameterError: an effect that is not allowed.
            InputError: something that is no list of effects.
        """
        if not (isinstance(effects, Sequence) and all(isinstance(e, EffectParameters | Mapping) for e in effects)):
            raise InputError("effects: a list of EffectParameters or of mappings, as [[effect]] tables are, is needed")
        tables = [effect.to_mapping() if isinstance(effect, EffectParameters) else dict(effect) for effect in effects]
        return self.with_parameters(self._parameters.updated({"effect": tables}))

    def forward_dynamics_derivatives(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        p: ArrayLike,
        f_ext: ArrayLike | None = None,
        wrenches: Iterable[Wrench] | None = None,
        *,
        parameters: Sequence[str] = (),
    ) -> Derivatives:
        """Exact derivatives of q'' by lengths, rates, pressures and the parameters at some paths (``section.2.mass``).

        What it prepares for a set of parameters is kept for the next call.

        Raises:
            InputError: an array of the wrong shape or with a value that is not finite.
            ParameterError: there is no such parameter.
        """
        names = tuple(parameters)
        if names not in self._differentiators:
            self._differentiators[names] = differentiator(self, self._parameters, names, self.with_parameters)
        return self._differentiators[names](q, qd, p, f_ext, wrenches)

    def linearize(
        self, q: ArrayLike, qd: ArrayLike, p: ArrayLike, *, period: float | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A (6n, 6n) and B (6n, inputs) of x' = A x + B p for small deviations, x = (q, q'), from any state.

        With a ``period``, s, those from one period to the next, pressures held meanwhile.

        Raises:
            InputError: an array of the wrong shape or with a value that is not finite.
        """
        return linearized(self, q, qd, p, period)

    def __getstate__(self) -> object:
        """What a subclass has added: its attributes and slots, or None. The arm itself is its parameters."""
        state = super().__getstate__()
        attributes, slots = state if isinstance(state, tuple) else (state, None)
        slots = {name: value for name, value in (slots or {}).items() if name not in Arm.__slots__}
        return (attributes, slots) if attributes or slots else None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as the parameters, from which the model is built again, and what a subclass has added."""
        return (_built, (type(self), self._parameters), self.__getstate__())

    def __eq__(self, other: object) -> bool:
        """Whether all parameters and their provenance are equal."""
        if not isinstance(other, Arm):
            return NotImplemented
        return self._parameters == other._parameters

    def __hash__(self) -> int:
        """Hash of the values the model computes with."""
        return hash(self._parameters)

    def __repr__(self) -> str:
        """Name, sections, inputs and force model in one line."""
        count = self.section_count
        return (
            f"<Arm {self.name!r}: {count} section{'s' if count != 1 else ''}, {len(self.inputs)} inputs, "
            f"{self._parameters.force_model}>"
        )

    def _repr_html_(self) -> str:
        """Its sections, for notebooks."""
        rows = []
        for number, section in enumerate(self._parameters.sections, start=1):
            bellows = section.resolved_bellows(number)
            rows.append(
                (
                    number,
                    section.total_mass,
                    section.rest_length,
                    len(bellows),
                    ", ".join(dict.fromkeys(b.input for b in bellows)),
                    section.bellows_radius,
                    span(*section.length_range),
                    span(*section.pressure_range),
                )
            )
        headings = ("section", "mass [kg]", "rest length [m]", "bellows", "inputs", "radius [m]", "lengths [m]",
                    "pressures [Pa]")  # fmt: skip
        effects = [f"effect: {effect.kind} at {effect.where}" for effect in self._parameters.effects]
        title = f"Arm {self.name}, {self._parameters.force_model}, pneumatics {self.pneumatics_level}"
        return html_table(title, headings, rows, notes=effects)


def _built(cls: type[_Arm], parameters: ArmParameters) -> _Arm:
    """An arm of a class without asking that class: a subclass may want more to make one."""
    return Arm.__new__(cls, parameters)
