"""Stretches of rows in which something holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def spans_of(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row and row after the last of each stretch of true ones, in order; ``mask`` has the shape (m,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
