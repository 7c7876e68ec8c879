"""What the checks look at of a log: pressures, and motions in terms of the sections' bending and mean length.

Lengths are linear in bending and mean length (``bha.checkup.shape``), so those sections whose three numbers the
measured lengths determine are solved for; the other lengths (a single wire, wires through several sections) stay as
they are, as linear channels. Head positions that are known from the base on are inverted in closed form; a head after
one that is not measured stays as a linear channel too, linear about the straight arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.checkup.layout import Layout
from bha.checkup.response import Signals, even_grid
from bha.checkup.shape import from_heads, length_rows, to_heads
from bha.recordings.clock import later

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]

#: Singular values below this share of the largest one are none: lengths on one side tell no bending to the other.
_RANK = 1e-2
#: A gap between two readings longer than this, s (or five usual intervals), is not bridged by a straight line.
_LONGEST_GAP = 0.25


@dataclass(frozen=True)
class Seen:
    """One log; m rows, K lengths, n sections, J inputs.

    Attributes:
        name: of the log.
        time: s, shape (m,).
        pressures: what drives the arm, Pa absolute, shape (m, J).
        length_names: names of the length channels, K of them.
        length_rows: lengths over the coordinates, shape (K, 3n).
        lengths: m, shape (m, K).
        lengths_good: which count, shape (m, K).
        heads: positions in the base frame as the file places the camera, m, shape (m, n, 3); NaN where not measured.
        heads_good: which count, shape (m, n).
    """

    name: str
    time: Array
    pressures: Array
    length_names: tuple[str, ...]
    length_rows: Array
    lengths: Array
    lengths_good: Mask
    heads: Array
    heads_good: Mask

    def measured_heads(self) -> list[int]:
        """Sections whose head is measured, from 0."""
        return [i for i in range(self.heads.shape[1]) if self.heads_good[:, i].sum() >= 2]


@dataclass(frozen=True)
class Linear:
    """Channels that are linear in (u, v, l) of all sections: ``rows`` (C, n, 3)."""

    names: tuple[str, ...]
    rows: Array


def shape_rows(layout: Layout, length_over_coordinates: Array) -> Array:
    """Lengths over (u, v, l) of each section, shape (K, n, 3), out of lengths over the coordinates (K, 3n)."""
    n = layout.section_count
    blocks = length_over_coordinates.reshape(len(length_over_coordinates), n, 3)
    made = np.empty_like(blocks)
    for i in range(n):
        coordinates = np.array([length_rows(layout.coordinate_radius[i], a) for a in 2 * np.pi / 3 * np.arange(3)])
        made[:, i] = blocks[:, i] @ coordinates
    return made


def determined(rows: Array) -> tuple[list[int], Array]:
    """Which sections' (u, v, l) some lengths determine, and the matrix (3n, K) that solves for all of them."""
    count, n, _ = rows.shape
    if count == 0:
        return [], np.zeros((3 * n, 0))
    # Angles beside metres: put on one scale by the size of each column.
    flat = rows.reshape(count, 3 * n)
    scale = np.where(np.abs(flat).max(axis=0) > 0, np.linalg.norm(flat, axis=0), 1.0)
    solve = np.linalg.pinv(flat / scale, rcond=_RANK) / scale[:, None]
    resolved = solve @ flat
    found = [i for i in range(n) if np.allclose(resolved[3 * i : 3 * i + 3, 3 * i : 3 * i + 3], np.eye(3), atol=1e-6)]
    return found, solve


def signals(layout: Layout, seen: Seen, rows: int) -> tuple[Signals, dict[str, Linear]]:
    """The motions of a log on an even grid of at most ``rows`` times, and what its linear channels mean.

    Keys of motions: ``("lengths", i, "bending")``, ``("lengths", i, "length")``, the same with ``"heads"``, and
    ``("lengths", c, "channel")`` for linear channel c.
    """
    grid = even_grid(seen.time, rows)
    keep = later(seen.time)
    pressures = np.column_stack([np.interp(grid, seen.time[keep], p[keep]) for p in seen.pressures.T])
    good = np.ones(len(grid), dtype=np.bool_)
    motions: dict[tuple[str, int, str], Complex] = {}
    linear: dict[str, Linear] = {}
    usable = [k for k in range(len(seen.length_names)) if seen.lengths_good[:, k].sum() >= 2]
    if usable:
        good &= _length_motions(layout, seen, grid, usable, motions, linear)
    if heads := seen.measured_heads():
        good &= _head_motions(layout, seen, grid, heads, motions, linear)
    step = float(grid[1] - grid[0]) if len(grid) > 1 else 1.0
    return Signals(step, pressures, motions, good), linear


def _length_motions(
    layout: Layout,
    seen: Seen,
    grid: Array,
    usable: list[int],
    motions: dict[tuple[str, int, str], Complex],
    linear: dict[str, Linear],
) -> Mask:
    """Add what the lengths tell; returns where on the grid all of them are known."""
    good = np.ones(len(grid), dtype=np.bool_)
    table = np.empty((len(grid), len(usable)))
    for place, k in enumerate(usable):
        table[:, place], known = _on_grid(grid, seen.time, seen.lengths[:, k], seen.lengths_good[:, k])
        good &= known
    over_shape = shape_rows(layout, seen.length_rows[usable])
    sections, solve = determined(over_shape)
    solved = table @ solve.T
    for i in sections:
        motions["lengths", i, "bending"] = solved[:, 3 * i] + 1j * solved[:, 3 * i + 1]
        motions["lengths", i, "length"] = solved[:, 3 * i + 2].astype(np.complex128)
    # Lengths that only tell what is known already are left out.
    others = [i for i in range(layout.section_count) if i not in sections]
    left = [c for c in range(len(usable)) if np.any(over_shape[c, others])]
    if left:
        linear["lengths"] = Linear(tuple(seen.length_names[usable[c]] for c in left), over_shape[left])
        for place, c in enumerate(left):
            motions["lengths", place, "channel"] = table[:, c].astype(np.complex128)
    return good


def _head_motions(
    layout: Layout,
    seen: Seen,
    grid: Array,
    heads: list[int],
    motions: dict[tuple[str, int, str], Complex],
    linear: dict[str, Linear],
) -> Mask:
    """Add what the heads tell; returns where on the grid all of them are known."""
    good = np.ones(len(grid), dtype=np.bool_)
    table = np.empty((len(grid), len(heads), 3))
    for place, i in enumerate(heads):
        for axis in range(3):
            table[:, place, axis], known = _on_grid(grid, seen.time, seen.heads[:, i, axis], seen.heads_good[:, i])
        good &= known
    chain = 0
    while chain < len(heads) and heads[chain] == chain:
        chain += 1
    if chain:
        bending, length = from_heads(table[:, :chain], layout.base_offset[:chain], layout.head_offset[:chain])
        for i in range(chain):
            motions["heads", i, "bending"] = bending[:, i]
            motions["heads", i, "length"] = length[:, i].astype(np.complex128)
    if chain < len(heads):
        # Across the arm only: along it a head moves by the square of the bending too, which is not linear.
        names = tuple(f"{axis}{i + 1}" for i in heads[chain:] for axis in "xy")
        rows = head_rows(layout)[heads[chain:], :2]
        linear["heads"] = Linear(names, rows.reshape(-1, layout.section_count, 3))
        for place in range(len(names)):
            motions["heads", place, "channel"] = table[:, chain + place // 2, place % 2].astype(np.complex128)
    return good


def head_rows(layout: Layout) -> Array:
    """Head positions over (u, v, l) of each section about the straight arm, shape (n heads, 3 axes, n, 3)."""
    n = layout.section_count
    length = layout.length_range.mean(axis=1)
    rows = np.zeros((n, 3, n, 3))
    small = 1e-6

    def heads(bending: Complex, lengths: Array) -> Array:
        return to_heads(bending, lengths, layout.base_offset, layout.head_offset)

    for i in range(n):
        for k, change in enumerate((small, 1j * small, 0.0)):
            one = np.zeros(n)
            one[i] = 1.0
            step = small * one if k == 2 else np.zeros(n)
            away = change * one
            difference = heads(away.astype(np.complex128), length + step) - heads(
                -away.astype(np.complex128), length - step
            )
            rows[:, :, i, k] = difference / (2.0 * small)
    return rows


def _on_grid(grid: Array, time: Array, values: Array, good: Mask) -> tuple[Array, Mask]:
    """Values at the grid's times, linear between good readings, and where a reading is near enough."""
    at, given = time[good], values[good]
    first = later(at)
    at, given = at[first], given[first]
    steps = np.diff(at)
    longest = max(_LONGEST_GAP, 5.0 * float(np.median(steps))) if len(steps) else 0.0
    place = np.clip(np.searchsorted(at, grid, side="right"), 1, max(len(at) - 1, 1))
    known = np.ones(len(grid), dtype=np.bool_)
    if len(at) > 1:
        known = (at[place] - at[place - 1] <= longest) & (grid >= at[0]) & (grid <= at[-1])
    return np.interp(grid, at, given), known
