"""What the tables of a parameter file have in common: the strict model and the types of its values.

Every field states its unit, the values that are allowed and what it is; error texts, ``bha info`` and the pages of the
documentation are made from these, so that they cannot disagree with the check.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

#: Greatest size of a number: its square and cube are finite, and no quantity of an arm comes near it.
GREATEST = 1e30
#: Least size of a number that is divided by.
LEAST = 1e-30


# Strict: the text "1.5" or the switch true is a mistake where a number belongs, not a number.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-GREATEST, le=GREATEST)]
Positive = Annotated[Number, Field(ge=LEAST)]
NotNegative = Annotated[Number, Field(ge=0)]
Switch = Annotated[bool, Field(strict=True)]
Vector3 = tuple[Number, Number, Number]


def _increasing(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] >= limits[1]:
        message = "the range is empty, {low} is not below {high}"
        raise PydanticCustomError("bha_range", message, {"low": limits[0], "high": limits[1]})
    return limits


PositiveRange = Annotated[tuple[Positive, Positive], AfterValidator(_increasing)]
NotNegativeRange = Annotated[tuple[NotNegative, NotNegative], AfterValidator(_increasing)]
Polynomial = Annotated[tuple[Number, ...], Field(min_length=1, max_length=8)]


class Table(BaseModel):
    """One table of a parameter file: immutable, every key known."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def key(
    allowed: str,
    meaning: str = "",
    *,
    unit: str = "",
    left_out: str = "",
    default: Any = ...,
    alias: str | None = None,
    **limits: Any,
) -> Any:
    """Declare a key of a table, in words that errors and the documentation share.

    Args:
        allowed: the values it allows, with their unit in brackets.
        meaning: what it is.
        unit: the unit alone, empty where it has none.
        left_out: what holds without it, for the documentation, where ``default`` does not say so itself.
        default: its value where it is left out.
        alias: its name in the file, if it has another one here.
        limits: what pydantic checks.
    """
    said: dict[str, Any] = {"unit": unit, "allowed": allowed, "meaning": meaning, "left_out": left_out}
    description = f"{allowed}: {meaning}" if meaning else allowed
    return Field(default, description=description, alias=alias, json_schema_extra=said, **limits)


def table_error(message: str, at: str | tuple[str | int, ...] = "") -> PydanticCustomError:
    """An error found by comparing values of one table; ``at`` is the key to blame, if any.

    In a subtable it is the way there, dotted or, where a name comes from the file and may hold dots, as a tuple.
    """
    return PydanticCustomError("bha_table", "{message}", {"message": message, "key": at})


def stated_angle(angle: float | None, angle_deg: float | None) -> float:
    """The angle of a table with the keys ``angle`` and ``angle_deg``, rad.

    Raises:
        PydanticCustomError: none or both of them are given.
    """
    if angle is not None and angle_deg is None:
        return angle
    if angle is None and angle_deg is not None:
        return math.radians(angle_deg)
    found = "neither" if angle is None else "both"
    raise table_error(f"found {found} of angle and angle_deg; allowed: exactly one of them")


def nearest(name: str, allowed: Sequence[str]) -> str:
    """``; nearest allowed: 'mass'``, or all that is allowed where nothing is near."""
    near = difflib.get_close_matches(name.lower()[:100], allowed, n=1, cutoff=0.6)
    return f"; nearest allowed: {near[0]!r}" if near else f"; allowed: {', '.join(allowed)}"
