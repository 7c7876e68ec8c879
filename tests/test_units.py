"""Units against their definitions, and texts that are no units of the quantity."""

import pytest

from bha.logs.units import EXAMPLES, UnitError, factor_to_si, measures


@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [
        ("Pa", "Pa", 1.0),
        ("kPa", "Pa", 1e3),
        ("bar", "Pa", 1e5),
        ("mbar", "Pa", 1e2),
        ("psi", "Pa", 6894.757293168361),
        ("N/m^2", "Pa", 1.0),
        ("mm", "m", 1e-3),
        ("µm", "m", 1e-6),
        ("inch", "m", 0.0254),
        ("ms", "s", 1e-3),
        ("min", "s", 60.0),
        ("mm/s", "m/s", 1e-3),
        ("m s^-1", "m/s", 1.0),
        ("kgf", "N", 9.80665),
        ("kg*m/s**2", "N", 1.0),
    ],
)
def test_factors(unit: str, si: str, factor: float) -> None:
    assert factor_to_si(unit, si) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "si", "expected"),
    [
        ("mm", "Pa", "unit 'mm' does not fit; expected a pressure, such as Pa, kPa, bar, or kPa(g) for gauge pressure"),
        ("degC", "Pa", "unit 'degC' does not fit; expected a pressure"),
        ("kPaa", "Pa", "unit 'kPaa' is not known; expected a pressure"),
        ("psig", "Pa", "unit 'psig' is not known; expected a pressure"),
        ("", "m", "unit '' is not known; expected a length"),
        ("1", "m", "unit '1' is not known"),
        ("0.1 mm", "m", "unit '0.1 mm' is not known"),
        ("m^9^9^9^9", "m", "unit 'm^9^9^9^9' is not known"),
        ("m**(9**9**9)", "m", "is not known"),
        ("m^999999999", "m", "is not known"),
        ("__import__('os')", "m", "is not known"),
        ("m" * 1000, "m", "is not known"),
        ("m/(s", "m/s", "is not known"),
        ("deg", "1", "unit 'deg' does not fit"),
    ],
)
def test_what_is_no_unit_of_the_quantity(unit: str, si: str, expected: str) -> None:
    with pytest.raises(UnitError) as caught:
        factor_to_si(unit, si)
    assert expected in str(caught.value)
    assert not measures(unit, si)


def test_every_si_unit_measures_itself_only() -> None:
    for unit in EXAMPLES:
        assert [other for other in EXAMPLES if measures(f"1{unit}"[1:], other)] == [unit]
