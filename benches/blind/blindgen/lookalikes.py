"""Kinds that certain data cannot tell apart. A name from the same class is counted apart: neither right nor
plainly wrong.
"""

CLASSES: tuple[frozenset[str], ...] = (
    frozenset({"delay", "pressure_lag"}),
    frozenset({"pressure_lag", "valve_dead_band", "delay"}),
    frozenset({"weak_bellows", "pressure_gain", "pressure_offset", "base_tilt"}),
    frozenset({"length_offset", "pressure_offset"}),
    frozenset({"length_gain", "weak_bellows", "pressure_gain"}),
    frozenset({"friction", "hysteresis"}),
    frozenset({"hysteresis", "valve_dead_band"}),
    frozenset({"hysteresis", "creep"}),
    frozenset({"friction", "quadratic_damping", "bending_damping"}),
    frozenset({"effective_area", "pressure_gain"}),
    frozenset({"effective_area", "bending_nonlinear"}),
    frozenset({"bending_nonlinear", "section_coupling"}),
    frozenset({"bending_nonlinear", "bending_anisotropy"}),
    frozenset({"weak_bellows", "bending_anisotropy"}),
    frozenset({"base_tilt", "tool_drag"}),
)


def look_alike(a: str, b: str) -> bool:
    """Whether two different kinds share a class."""
    return a != b and any(a in group and b in group for group in CLASSES)
