"""Tables of what files may hold, from the schemas that check them.

- ``{keys} bha.parameters.SectionParameters``: the keys of a table of a file: what each is, what is allowed, and what
  holds where it is left out. Lines of content, if any, choose keys.
- ``{columns}``: the columns of logs and trajectories, by ``bha.names``.
- ``{effects}``: the kinds of effects, by the registry of the core.
"""

from __future__ import annotations

import importlib
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from bha import names
from bha.parameters import EFFECT_KINDS
from bha.parameters.base import Table

#: The schemas speak ASCII, as terminals do.
SIGNS = {r"\bpsi\b": "ψ", r"\balpha\b": "α", r"\bphi\b": "φ", r"\^2\b": "²", r"\^3\b": "³", ">=": "≥", "<=": "≤"}
#: In words of the documentation, for the kinds of ``bha.names``; with the function that writes their name.
COLUMNS = {
    "time": ("time", lambda: names.TIME),
    "pressure": ("pressure, measured", lambda: names.pressure_name(1, 1)),
    "commanded_pressure": ("pressure, commanded", lambda: names.commanded_pressure_name(1, 1)),
    "length": ("length of a bellows", lambda: names.length_name(1, 1)),
    "velocity": ("velocity of a bellows", lambda: names.velocity_name(1, 1)),
    "coordinate": ("coordinate (virtual length)", lambda: names.coordinate_name(1, 1)),
    "coordinate_velocity": ("velocity of a coordinate", lambda: names.coordinate_velocity_name(1, 1)),
    "position": ("position of a head", lambda: " ".join(names.position_names(1))),
    "orientation": (
        "orientation of a head: unit quaternion, scalar first",
        lambda: " ".join(names.orientation_names(1)),
    ),
    "force": ("external force on a section, in the world", lambda: " ".join(names.force_names(1))),
}


def readable(text: str) -> str:
    """Words of a schema as Markdown: names of keys as code, signs as print has them."""
    for ascii_sign, sign in SIGNS.items():
        text = re.sub(ascii_sign, sign, text)
    text = re.sub(r'\[(?:"[^"]*"(?:, )?)+\]|"[^"]*"|\[\[?[a-z_.]+\]\]?(?!\()', lambda found: f"`{found[0]}`", text)
    text = re.sub(r"(?<![`\w.\"\[])[a-z0-9]+(?:_[a-z0-9]+)+(?![\w`\"])", lambda found: f"`{found[0]}`", text)
    return text.replace("|", "\\|")


def plain(number: float) -> str:
    """A number as one writes it: 1e6, not 1e+06."""
    return re.sub(r"e([+-])0*", lambda found: "e" + found[1].strip("+"), f"{number:g}")


def default(field: FieldInfo, said: dict[str, str]) -> str:
    """What holds where a key is left out."""
    if said.get("left_out"):
        return readable(said["left_out"])
    if field.default is PydanticUndefined and field.default_factory is None:
        return "**needed**"
    value = field.get_default(call_default_factory=True)
    if value is None or isinstance(value, Table) or value == ():
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        entries = (f'"{entry}"' if isinstance(entry, str) else plain(entry) for entry in value)
        return f"`[{', '.join(entries)}]`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{plain(value)}`"


def rows_of_keys(table: type[Table], chosen: Sequence[str] = ()) -> Iterator[list[str]]:
    """Key, what it is, what is allowed, what holds where it is left out; as Markdown."""
    for name, field in table.model_fields.items():
        key = field.alias or name
        said: Any = field.json_schema_extra
        if name == "provenance" or (chosen and key not in chosen):
            continue
        yield [f"`{key}`", readable(said["meaning"]), readable(said["allowed"]), default(field, said)]


def rows_of_columns() -> Iterator[list[str]]:
    """Quantity, name and unit of each kind of column; as Markdown."""
    for kind, (quantity, name) in COLUMNS.items():
        unit = names.Quantity(kind).unit
        yield [quantity, " ".join(f"`{part}`" for part in name().split()), "" if unit == "1" else unit]


def rows_of_effects() -> Iterator[list[str]]:
    """Kind, where it may act, what it is, its numbers; as Markdown."""
    for kind in EFFECT_KINDS.values():
        numbers = []
        for number in kind.parameters:
            limits = f"{plain(number.low)} to {plain(number.high)} {readable(number.unit)}".rstrip()
            otherwise = "" if number.default is None else f"; `{plain(number.default)}`"
            numbers.append(f"`{number.name}` ({limits}{otherwise}): {readable(number.meaning)}")
        yield [f"`{kind.kind}`", ", ".join(kind.places), readable(kind.summary), "<br>".join(numbers)]


def markdown(headings: Sequence[str], rows: Iterator[list[str]]) -> list[str]:
    """A table as lines of Markdown."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return [f"| {' | '.join(headings)} |", "|---" * len(headings) + "|", *lines]


class GeneratedTable(SphinxDirective, ABC):
    """A directive that stands for a table in Markdown."""

    has_content = True

    @abstractmethod
    def lines(self) -> list[str]:
        """The table."""

    def run(self) -> list[nodes.Node]:
        """The table, parsed as if it stood in the page."""
        holder = nodes.container(classes=["generated"])
        self.state.nested_parse(StringList(self.lines(), source=self.get_source_info()[0]), self.content_offset, holder)
        return holder.children


class Keys(GeneratedTable):
    """The directive ``keys``."""

    required_arguments = 1

    def lines(self) -> list[str]:
        """The keys of a table of a file."""
        module, _, name = self.arguments[0].rpartition(".")
        table = getattr(importlib.import_module(module), name)
        chosen = " ".join(self.content).split()
        return markdown(("key", "what it is", "allowed", "left out"), rows_of_keys(table, chosen))


class Columns(GeneratedTable):
    """The directive ``columns``."""

    def lines(self) -> list[str]:
        """The columns of logs and trajectories."""
        return markdown(("quantity", "name", "SI unit"), rows_of_columns())


class Effects(GeneratedTable):
    """The directive ``effects``."""

    def lines(self) -> list[str]:
        """The kinds of effects."""
        return markdown(("kind", "where", "what it is", "numbers (range and unit; default)"), rows_of_effects())


def setup(app: Sphinx) -> dict[str, bool]:
    """Add to Sphinx."""
    for name, directive in (("keys", Keys), ("columns", Columns), ("effects", Effects)):
        app.add_directive(name, directive)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
