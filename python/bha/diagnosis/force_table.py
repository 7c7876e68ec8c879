"""A residual force as a table that a simulation can carry: the force of a bellows over its length, rate or pressure.

It is no cause. It says by how many newtons the model errs where logs were, and nothing on why; beyond them its edge
values hold. In an arm it stands last among the effects, as ``formula`` terms, a curve each.
Limits: nothing keeps such a force from giving energy to the arm. It is bounded, since its edges hold, so that it cannot
drive an arm without bound; it can keep one swinging.
"""

from __future__ import annotations

import os
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from bha.arm import Arm
from bha.diagnosis.result import Finite, Table
from bha.errors import InputError, ParameterError, way_out
from bha.parameters import Place
from bha.parameters.document import merged_toml
from bha.support.files import written_whole

Array = NDArray[np.float64]

#: What a table is called wherever it is carried.
NO_CAUSE = "residual force table: empirical, no cause"
Variable = Literal["q", "qd", "p"]
#: What a variable is, and its unit.
VARIABLES: dict[str, tuple[str, str]] = {
    "q": ("length", "m"),
    "qd": ("rate", "m/s"),
    "p": ("pressure", "Pa absolute"),
}


class Curve(Table):
    """The force of a bellows over one variable, straight between nodes, held beyond them.

    Attributes:
        variable: ``q`` (length, m), ``qd`` (its rate, m/s) or ``p`` (pressure, Pa absolute), of that bellows.
        nodes: values of the variable, ascending.
        force: at the nodes, N; positive pushes the bellows' ends apart.
        deviation: standard deviations of these, N.
    """

    variable: Variable
    nodes: Annotated[list[Finite], Field(min_length=2)]
    force: list[Finite]
    deviation: list[Finite]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not len(self.nodes) == len(self.force) == len(self.deviation):
            raise ValueError("nodes, force and deviation: found different lengths; one number a node is needed in each")
        if any(b <= a for a, b in pairwise(self.nodes)):
            raise ValueError("nodes: found numbers that do not ascend; ascending ones are needed")
        return self

    def value(self, at: Array) -> Array:
        """The force at values of the variable, N."""
        return np.interp(at, self.nodes, self.force)

    def formula(self) -> str:
        """The same as the text of a ``formula``."""
        parts = [f"{self.force[0]:.9g}"]
        for (a, b), (low, high) in zip(pairwise(self.nodes), pairwise(self.force), strict=True):
            slope = (high - low) / (b - a)
            if slope:
                parts.append(f"{slope:.9g} * (min(max({self.variable}, {a:.9g}), {b:.9g}) - {a:.9g})")
        return " + ".join(parts)


class Bellows(Table):
    """The curves of one bellows, or of each bellows of a section: their forces add up.

    Attributes:
        where: ``bellows 12`` or ``section 1``.
        curves: over different variables.
    """

    where: str
    curves: Annotated[list[Curve], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> Self:
        place = Place.read(self.where)
        if place is None or place.sort not in ("section", "bellows"):
            raise ValueError(f'where: found "{self.where}"; allowed: "section 1" or "bellows 12"')
        return self


class ResidualTable(Table):
    """``residual_table.toml``: what ``bha simulate --residual`` carries.

    Attributes:
        note: what it is, and what it is not.
        arm: name of the arm beside whose model it acts.
        logs: that it was found from.
        without: error on the held-out logs without it, m RMS, open loop.
        error: the same with it.
        tables: the forces.
    """

    schema_name: Literal["bha-residual/1"] = Field("bha-residual/1", alias="schema")
    note: str = NO_CAUSE
    arm: str
    logs: list[str]
    without: Finite
    error: Finite
    tables: Annotated[list[Bellows], Field(min_length=1)]

    def effects(self) -> list[dict[str, str]]:
        """The ``[[effect]]`` tables that act as it does."""
        return [
            {"kind": "formula", "where": bellows.where, "force": curve.formula()}
            for bellows in self.tables
            for curve in bellows.curves
        ]

    def carried(self, arm: Arm) -> Arm:
        """``arm`` with this table after all its effects, and said so in its name.

        Raises:
            InputError: the arm has no such places.
        """
        try:
            made = arm.with_effects([*arm.parameters.effects, *self.effects()])
        except ParameterError as error:
            raise InputError(f"the residual table of {self.arm} does not fit the arm {arm.name}: {error}") from error
        return made.with_parameters(made.parameters.updated({"name": f"{arm.name} ({NO_CAUSE})"}))

    def in_words(self) -> str:
        """What it is, where it is known, and where it is not, a sentence."""
        spans = {
            curve.variable: (curve.nodes[0], curve.nodes[-1]) for bellows in self.tables for curve in bellows.curves
        }
        for bellows in self.tables:
            for curve in bellows.curves:
                low, high = spans[curve.variable]
                spans[curve.variable] = (min(low, curve.nodes[0]), max(high, curve.nodes[-1]))
        ranges = ", ".join(
            f"{VARIABLES[name][0]} {low:.4g} to {high:.4g} {VARIABLES[name][1]}" for name, (low, high) in spans.items()
        )
        return f"{self.note}; known for {ranges}, held at its edges beyond"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write it, whole or not at all.

        Raises:
            InputError: the folder does not exist.
        """
        with written_whole(path) as temporary:
            text = merged_toml(self.model_dump(mode="json", by_alias=True), None)
            temporary.write_text(text, encoding="utf-8", newline="\n")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ResidualTable:
        """Read a file that ``bha diagnose`` has written, or one like it.

        Raises:
            InputError: it is missing, or none; the text says what is wrong where.
        """
        try:
            mapping: dict[str, Any] = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {way_out(error)}") from error
        except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(
                f"{path}: no residual table: {error}; residual_table.toml of bha diagnose is needed"
            ) from error
        try:
            return cls.model_validate(mapping)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"]) or "the table"
            raise InputError(f"{path}: no residual table: {place}: {first['msg']}") from error
