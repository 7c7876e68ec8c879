"""The arm: what a parameter file says, and the model computed from it by the core."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.parameters import ArmParameters, EffectParameters, ForceModel, PneumaticsLevel

if TYPE_CHECKING:
    from bha.derivatives import Derivatives


class Arm(_core.Arm):
    """An arm, immutable. The numerical methods are those of the core and are inherited as they are.

    Create one with :meth:`load`, :func:`bha.robots.load` or :meth:`from_parameters`.
    """

    __slots__ = ("_differentiators", "_parameters")
    _parameters: ArmParameters
    _differentiators: dict[tuple[str, ...], Callable[..., Derivatives]]

    def __new__(cls, parameters: ArmParameters) -> Self:
        """Build the model of ``parameters``; the same as :meth:`from_parameters`."""
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
        """
        changes: dict[str, Any] = {
            "name": name,
            "gravity": None if gravity is None else [float(entry) for entry in gravity],
            "ambient_pressure": ambient_pressure,
            "force_model": force_model,
            "rotational_energy": rotational_energy,
            "coriolis_forces": coriolis_forces,
        }
        if pneumatics is not None and (self.pneumatics_level, pneumatics) != ("ideal", "ideal"):
            table = self._parameters.to_mapping().get("pneumatics", {})
            changes["pneumatics"] = {**table, "level": pneumatics}
        changes = {key: value for key, value in changes.items() if value is not None}
        return type(self)(self._parameters.updated(changes))

    def with_effects(self, effects: Sequence[EffectParameters | Mapping[str, Any]]) -> Self:
        """A new arm with these effects in place of its own ones; ``[]`` takes all away.

        Args:
            effects: :class:`bha.parameters.EffectParameters`, or mappings with the keys of an ``[[effect]]`` table.
                To add one: ``arm.with_effects([*arm.parameters.effects, {"kind": "creep", ...}])``.

        Raises:
            ParameterError: an effect that is not allowed.
        """
        tables = [effect.to_mapping() if isinstance(effect, EffectParameters) else dict(effect) for effect in effects]
        return type(self)(self._parameters.updated({"effect": tables}))

    def forward_dynamics_derivatives(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        p: ArrayLike,
        f_ext: ArrayLike | None = None,
        *,
        parameters: Sequence[str] = (),
    ) -> Derivatives:
        """Exact derivatives of q'' by lengths, rates, pressures and the parameters at some paths (``section.2.mass``).

        What it prepares for a set of parameters is kept for the next call.

        Raises:
            InputError: an array of the wrong shape or with a value that is not finite.
            ParameterError: there is no such parameter.
        """
        from bha.derivatives import differentiator  # noqa: PLC0415  (it needs this module's class)

        names = tuple(parameters)
        if names not in self._differentiators:
            self._differentiators[names] = differentiator(self, names)
        return self._differentiators[names](q, qd, p, f_ext)

    def linearize(self, q: ArrayLike, qd: ArrayLike, p: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A (6n, 6n) and B (6n, inputs) of x' = A x + B p for small deviations, x = (q, q'), from any state.

        Raises:
            InputError: an array of the wrong shape or with a value that is not finite.
        """
        return _core.linearize(self, q, qd, p)

    def __reduce__(self) -> tuple[type[Self], tuple[ArmParameters]]:
        """Pickle as the parameters; the model is built again from them."""
        return (type(self), (self._parameters,))

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
