"""Pneumatics from Python: levels, parameter errors, and what a simulation makes of commands."""

import numpy as np
import pytest
from independent_pneumatics import OneInput
from numpy.typing import NDArray

import bha
from bha.errors import ParameterError
from bha.parameters import ArmParameters

NOMINAL = bha.robots.parameters("bha_nominal")


def steps(arm: bha.Arm) -> bha.Input:
    """A step of all pressures at 0.1 s, up, and at 0.5 s, down."""
    rows = np.array([1.2e5, 1.5e5, 1.1e5])[:, None] * np.ones(len(arm.inputs))
    return bha.Input(np.array([0.0, 0.1, 0.5]), rows)


def run(arm: bha.Arm, **options: object) -> bha.Trajectory:
    choice = bha.Options(interpolation="hold", **options)  # type: ignore[arg-type]
    return bha.simulate(arm, steps(arm), t_end=0.8, dt=0.01, options=choice)


def test_one_key_chooses_the_level() -> None:
    arm = bha.robots.load("bha_nominal")
    assert arm.pneumatics_level == "ideal"
    ideal = run(arm)
    without = bha.Arm.from_parameters(ArmParameters.from_mapping(without_table(NOMINAL)))
    assert np.array_equal(ideal.lengths, run(without).lengths)
    lag, full = (run(arm.with_changes(pneumatics=level)) for level in ("lag", "full"))
    after = np.searchsorted(ideal.time, 0.105)
    assert ideal.pressures[after, 0] == 1.5e5
    for slow in (lag, full):
        assert slow.pressures[after, 0] < 1.35e5
        assert slow.pressures[48] == pytest.approx(1.5e5, abs=300)
        assert slow.pressures[-1] == pytest.approx(1.1e5, abs=700)


def without_table(parameters: ArmParameters) -> dict[str, object]:
    mapping = parameters.to_mapping()
    del mapping["pneumatics"]
    return mapping


def test_lag_has_its_own_times_for_filling_and_venting() -> None:
    arm = bha.robots.load("bha_nominal").with_changes(pneumatics="lag")
    found = run(arm)
    table = arm.parameters.pneumatics
    assert table is not None
    assert table.fill_time is not None
    assert table.vent_time is not None
    t = found.time
    filling = 1.5e5 - 0.3e5 * np.exp(-(t - 0.1) / table.fill_time)
    last = 1.5e5 - 0.3e5 * np.exp(-0.4 / table.fill_time)
    venting = 1.1e5 + (last - 1.1e5) * np.exp(-(t - 0.5) / table.vent_time)
    expected = np.where(t < 0.1, 1.2e5, np.where(t < 0.5, filling, venting))
    assert found.pressures[:, 4] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("level", ["lag", "full"])
def test_one_millisecond_is_as_good_as_tiny_steps(level: bha.parameters.PneumaticsLevel) -> None:
    arm = bha.robots.load("bha_nominal").with_changes(pneumatics=level)
    coarse, fine = run(arm, method="rk4", step=1e-3), run(arm, method="rk4", step=2e-5)
    assert np.abs(coarse.lengths - fine.lengths).max() < 2e-5
    assert np.abs(coarse.pressures - fine.pressures).max() < 200
    assert np.abs(run(arm).lengths - fine.lengths).max() < 4e-5


def test_measured_pressures_bypass_the_pneumatics() -> None:
    arm = bha.robots.load("bha_nominal").with_changes(pneumatics="full")
    drive = steps(arm)
    measured = bha.Input(drive.time, drive.pressures, commanded=False)
    choice = bha.Options(interpolation="hold")
    found = bha.simulate(arm, measured, t_end=0.3, dt=0.01, options=choice)
    ideal = bha.simulate(arm.with_changes(pneumatics="ideal"), drive, t_end=0.3, dt=0.01, options=choice)
    assert np.array_equal(found.lengths, ideal.lengths)


def test_effects_on_pressures_act_between_chambers_and_bellows() -> None:
    lagging = bha.robots.load("bha_nominal").with_changes(pneumatics="full")
    arm = lagging.with_effects([{"kind": "pressure_gain", "where": "all", "gain": 0.05}])
    plain, changed = run(lagging), run(arm)
    # The chambers follow their commands all the same, but for the volumes; the arm feels 5 % more.
    assert np.abs(plain.pressures - changed.pressures).max() < 3e3
    assert np.abs(plain.lengths - changed.lengths)[45].max() > 1e-3


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('level = "ideal"', 'level = "exact"', 'level: found "exact"; allowed: "ideal" or "lag" or "full"'),
        ("fill_time = 0.03", "fill_time = -0.03", "fill_time: found -0.03; allowed: a number > 0 (s)"),
        ("supply_pressure = 3.5e5", "supply_pressure = 1e5", "allowed: above exhaust_pressure, 101325.0"),
        ("vacuum_pressure = 0.5e5", "vacuum_pressure = 2e5", "allowed: below exhaust_pressure, 101325.0"),
        ("spool_time = 0.002", "spoole_time = 0.002", "unknown key; nearest allowed: 'spool_time'"),
    ],
)
def test_errors_name_line_key_found_and_allowed(old: str, new: str, expected: str) -> None:
    text = NOMINAL.to_toml()
    assert old in text
    with pytest.raises(ParameterError) as caught:
        ArmParameters.from_toml(text.replace(old, new), origin="arm.toml")
    line = text[: text.index(old)].count("\n") + 1
    assert expected in str(caught.value)
    assert f"arm.toml, line {line}: " in str(caught.value)
    assert "pneumatics" in str(caught.value)


def test_a_level_says_what_it_lacks() -> None:
    table = {"level": "full", "supply_pressure": 3e5}
    with pytest.raises(ParameterError, match='exhaust_pressure: missing; level = "full" needs it'):
        NOMINAL.updated({"pneumatics": table})


def test_file_and_provenance_survive_a_round_trip() -> None:
    text = NOMINAL.to_toml() + '\n[pneumatics.provenance]\nspool_time = "identified"\n'
    parameters = ArmParameters.from_toml(text)
    again = ArmParameters.from_toml(parameters.to_toml())
    assert again == parameters
    stated = {value.key: value for value in again.stated_values()}
    assert stated["spool_time"].provenance.status == "identified"
    assert stated["sonic_conductance"].unit == "m^3/(s Pa)"
    changed = parameters.updated({"pneumatics": {**parameters.to_mapping()["pneumatics"], "level": "full"}})
    assert "# Off unless level" in changed.to_toml()


def test_against_an_independent_implementation() -> None:
    """Chamber, valve, spool and controller in plain Python along the core's own motion: at small steps, and at 1 ms.

    What explicit steps make of the same equations, and stiffer valves, is in benches/pneumatics_steps.py.
    """
    pytest.importorskip("scipy")
    arm = bha.robots.load("bha_nominal").with_changes(pneumatics="full")
    times = np.arange(121) * 1e-3
    commands = np.where(times < 0.06 - 1e-9, 2.0e5, 0.8e5)
    commands[0] = 1.2e5
    drive = bha.Input(times, np.repeat(commands[:, None], 9, axis=1))
    coarse, fine = (
        bha.simulate(arm, drive, dt=1e-3, options=bha.Options(method="rk4", step=step, interpolation="hold"))
        for step in (1e-3, 2e-5)
    )
    table = arm.parameters.to_mapping()["pneumatics"]
    for section in (0, 2):
        part, lengths = arm.parameters.sections[section], fine.lengths[:, 3 * section]
        alone = OneInput(table, arm.parameters.ambient_pressure, part.terminal_area * sum(part.length_range) / 2)

        def volume(t: float, area: float = part.terminal_area, q: NDArray[np.float64] = lengths) -> float:
            return float(table["dead_volume"]) + area * float(np.interp(t, times, q))

        expected = alone.pressures(times, volume, commands, 1.2e5)
        assert np.ptp(expected) > 0.3e5
        # Lengths between two rows are straight lines for the one, not for the other: some pascals.
        assert fine.pressures[:, 3 * section] == pytest.approx(expected, abs=5.0)
        assert coarse.pressures[:, 3 * section] == pytest.approx(expected, abs=50.0)
