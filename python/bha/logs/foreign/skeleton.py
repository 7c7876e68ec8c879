"""What a foreign file has, as a mapping file that is ready to be edited: TOML, what is not told commented out."""

from __future__ import annotations

import re
from collections.abc import Sequence

import tomlkit

from bha.logs.foreign.mapping import SCHEMA
from bha.logs.foreign.series import Part

_MOST, _NOTHING = 400, '""'


def skeleton(name: str, parts: Sequence[Part], *, stamps: bool, doubts: Sequence[str] = ()) -> str:
    """A mapping file for a log called ``name``, by what it has.

    Args:
        name: the file's name, for its first line.
        parts: what it has.
        stamps: whether it has messages, so that a stamp can be chosen.
        doubts: what cannot be read, a text each.
    """
    lines = [
        f"# What {name} has, as a mapping file. Give each part that you want the name and unit of a column of a log",
        '# such as "p11 [bar(g)]" (docs: Measured logs); lines that begin with # do not count. Units and numbers of',
        "# sections are proposals: check them.",
        *(f"# {doubt}" for doubt in doubts),
        f'schema = "{SCHEMA}"',
        "",
    ]
    if stamps:
        lines += ["# [time]", '# stamp = "header"    # or "received": when measured, or when recorded', ""]
    lines.append("[columns]")
    taken: set[str] = set()
    rows = [_row(part, taken) for part in parts[:_MOST]]
    width = min(max((len(text) for text, _ in rows), default=0), 70)
    lines += [f"{text:<{width}}  # {comment}" if comment else text for text, comment in rows]
    if len(parts) > _MOST:
        lines.append(f"# ... and {len(parts) - _MOST} more")
    if not any(text and not text.startswith("#") for text, _ in rows):
        lines.append('# "..." = "p11 [Pa]"    # nothing was recognized: take the # from a line above and fill it in')
    return "\n".join(lines) + "\n"


def _row(part: Part, taken: set[str]) -> tuple[str, str]:
    key = tomlkit.item(part.source).as_string()
    rate = "" if part.rate is None else f"{part.rate:.4g} Hz"
    count = f"{part.count} samples" if part.count and not part.shape else ""
    comment = ", ".join(filter(None, [part.kind, part.shape, count, rate, part.about]))
    proposal = part.proposal
    # Two topics that look alike must not fill one column: the second waits for a decision.
    channels = set(re.findall(r"[a-z]+\d+|head = \d+", proposal))
    if not proposal or channels & taken:
        return f"# {key} = {proposal or _NOTHING}", comment
    taken |= channels
    return f"{key} = {proposal}", comment
