"""Where a value comes from: published, measured, assumed or identified, and for identified ones how well it is known.

In the file, a ``[provenance]`` table beside the values (``[section.provenance]`` in a section,
``[section.bellows.provenance]`` in a bellows) names the key and says either just the status or more::

    [section.provenance]
    bellows_radius = "published"
    length_range = { status = "published", source = "T-RO 31(6), 2015" }
    mass = { status = "identified", ci95 = [0.74, 0.76], logs = [{ name = "swing.csv", sha256 = "9f86..." }] }

A value without an entry counts as assumed: nothing becomes trustworthy by silence.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from bha.parameters.base import NotNegative, Number, Table, key, nearest, table_error

Status = Literal["published", "measured", "assumed", "identified"]
STATUS_ALLOWED = 'one of "published", "measured", "assumed", "identified"'


class LogReference(Table):
    """A measured log that a value was identified from."""

    name: str = key("the file name of the log, without folders", min_length=1)
    sha256: str = key("the SHA-256 of the file, 64 hexadecimal digits", pattern="^[0-9a-f]{64}$")


def _interval(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] > interval[1]:
        raise table_error(f"the interval [{interval[0]}, {interval[1]}] is reversed")
    return interval


Interval = Annotated[tuple[Number, Number], AfterValidator(_interval)]


class Provenance(Table):
    """Where one value comes from.

    Attributes:
        status: published, measured (by a tape or a scale, on this very arm), assumed or identified.
        source: publication, data sheet or reasoning, free text.
        ci95: 95 % confidence interval ``(low, high)`` in the unit of the value; one interval per entry for a list.
        standard_error: standard error in the unit of the value; one per entry for a list.
        logs: the measured logs it was identified from.
    """

    status: Status = key(STATUS_ALLOWED)
    source: str | None = key("text", default=None)
    ci95: Interval | tuple[Interval, ...] | None = key("[low, high]; for a list one per entry", default=None)
    standard_error: NotNegative | tuple[NotNegative, ...] | None = key(
        "a number >= 0; for a list one per entry", default=None
    )
    logs: tuple[LogReference, ...] = key("a list of { name = ..., sha256 = ... }", default=())

    def to_mapping(self) -> str | dict[str, Any]:
        """The entry as it stands in a file: the bare status if there is nothing else to say."""
        mapping = self.model_dump(mode="json", exclude_unset=True, exclude_none=True)
        return self.status if set(mapping) == {"status"} else mapping


ASSUMED = Provenance(status="assumed")


def _from_status(entry: Any) -> Any:
    return {"status": entry} if isinstance(entry, str) else entry


ProvenanceTable = dict[str, Annotated[Provenance, BeforeValidator(_from_status)]]


def published(provenance: Mapping[str, Provenance]) -> set[str]:
    """Names of the values that are published, and so known; angles without the ``_deg`` that a file may give them."""
    return {name.removesuffix("_deg") for name, entry in provenance.items() if entry.status == "published"}


def provenance_key() -> Any:
    """The ``[provenance]`` table of a table."""
    return Field(
        default_factory=dict,
        description=f"a table from key to {STATUS_ALLOWED}, or to a table with one of these as its status",
        json_schema_extra={"unit": ""},
    )


def provenance_mapping(entries: Mapping[str, Provenance]) -> dict[str, Any]:
    """The ``[provenance]`` table as it stands in a file."""
    return {name: entry.to_mapping() for name, entry in entries.items()}


def check_provenance(entries: dict[str, Provenance], values: dict[str, Any]) -> None:
    """Check that every entry names a value of this table and that its statistics have the shape of that value.

    Raises:
        PydanticCustomError: with what is wrong; pydantic adds where.
    """
    for name, entry in entries.items():
        if name not in values:
            message = "there is no such value in this table" + nearest(name, list(values))
            raise table_error(message, ("provenance", name))
        value = values[name]
        expected = len(value) if isinstance(value, tuple) else None
        if entry.ci95 is not None:
            found = len(entry.ci95) if entry.ci95 and isinstance(entry.ci95[0], tuple) else None
            _check_count(name, "ci95", found, expected)
        if entry.standard_error is not None:
            found = len(entry.standard_error) if isinstance(entry.standard_error, tuple) else None
            _check_count(name, "standard_error", found, expected)


def _check_count(name: str, statistic: str, found: int | None, expected: int | None) -> None:
    """Compare numbers of entries; None stands for a single number or a single interval."""
    if found != expected:
        texts = ("a single one" if count is None else f"a list of {count}" for count in (found, expected))
        message = "found {}; allowed: {}, as the value has".format(*texts)
        raise table_error(message, ("provenance", name, statistic))
