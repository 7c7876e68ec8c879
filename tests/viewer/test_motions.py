"""What is shown of logs and trajectories, and the clock over it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bha
from bha.errors import InputError, LogError
from bha.viewer.colors import UNKNOWN, PressureScale, linear_light
from bha.viewer.motions import MAGNIFICATIONS, Measured, Motion, drawn_gap, magnification, motions_of, part
from bha.viewer.pages import picture_times
from bha.viewer.show import Show

from . import made_log as made

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def log() -> bha.Log:
    return made.log()


def test_a_log_drives_a_simulation_beside_its_heads(log: bha.Log) -> None:
    arm = made.arm()
    (motion,) = motions_of(arm, [log])
    assert (motion.time[0], motion.time[-1]) == (100.0, 102.0)
    run = bha.simulate(arm, log, times=[100.0, 101.0, 102.0])
    assert log.head_positions is not None
    for k, time in enumerate((100.0, 101.0, 102.0)):
        moment = motion.at(time)
        np.testing.assert_allclose(moment.lengths, run.lengths[k], atol=1e-6)
        np.testing.assert_allclose(moment.heads, run.head_positions[k], atol=1e-6)
        np.testing.assert_allclose(moment.measured, log.head_positions[50 * k], atol=1e-12)
        np.testing.assert_allclose(moment.pressures, log.pressures(arm.inputs)[50 * k])
    gaps = motion.gaps()
    assert gaps is not None
    errors = bha.Recording(arm, log, warn=False).errors(bha.simulate(arm, log)).reshape(-1, 3, 3)
    assert np.nanmax(gaps) == pytest.approx(np.nanmax(np.linalg.norm(errors, axis=-1)), rel=1e-2)
    assert 1e-3 < np.nanmax(gaps) < 0.1


def test_nothing_is_measured_outside_of_the_measurements(log: bha.Log) -> None:
    (motion,) = motions_of(made.arm(), [log])
    assert np.isnan(motion.at(99.9).measured).all()
    assert np.isnan(motion.at(102.1).measured).all()
    np.testing.assert_array_equal(motion.at(99.0).lengths, motion.lengths[0])
    assert np.isnan(motions_of(made.arm(), [made.log(heads=False)])[0].at(101.0).gap).all()


def test_between_rows_stands_the_straight_line_and_a_missing_row_hides_no_other() -> None:
    time = np.array([0.0, 1.0, 1.0, 2.0])  # a jump at 1 s
    rows = np.array([[0.0], [2.0], [4.0], [np.nan]])
    heads = np.zeros((4, 1, 3))
    motion = Motion("m", time, rows, rows, heads, Measured(time, heads + rows[:, None]))
    shown = [float(motion.at(t).lengths[0]) for t in (0.0, 0.25, 1.0, 3.0)]
    assert shown[:3] == [0.0, 0.5, 4.0]
    assert np.isnan(shown[3])
    assert np.isnan(motion.at(1.5).measured).all()
    assert motion.at(0.5).gap.tolist() == [[1.0, 1.0, 1.0]]
    assert Motion("one", time[:1], rows[:1], rows[:1], heads[:1]).at(5.0).lengths.tolist() == [0.0]


@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".parquet", ".npz"])
@pytest.mark.parametrize("name", ["bha_nominal", "asu_two_section"])
def test_trajectories_are_shown_as_they_were_written(tmp_path: Path, ending: str, name: str) -> None:
    if ending == ".parquet":
        pytest.importorskip("pyarrow")
    arm = bha.robots.load(name)
    inputs = len(arm.inputs)
    time = np.linspace(0.0, 0.5, 26)
    run = bha.simulate(arm, bha.Input(time, 1.2e5 + 2e4 * np.sin(time)[:, None] * np.arange(inputs)), times=time)
    run.write(tmp_path / f"run{ending}")
    (motion,) = motions_of(arm, [tmp_path / f"run{ending}"])
    (given,) = motions_of(arm, [run])
    assert motion.label == f"run{ending}"
    for t in (0.0, 0.31, 0.5):
        for what in ("lengths", "heads", "pressures"):
            np.testing.assert_allclose(getattr(motion.at(t), what), getattr(given.at(t), what), rtol=1e-9, atol=1e-9)


def test_what_cannot_be_shown_is_said(tmp_path: Path, log: bha.Log) -> None:
    arm = made.arm()
    with pytest.raises(LogError, match="p11"):
        motions_of(arm, [bha.Log.from_arrays({"t [s]": [0.0, 1.0], "x1 [m]": [0.0, 0.0]})])
    other = bha.simulate(bha.robots.load("asu_two_section"), bha.Input.constant(np.full(6, 1.2e5), 0.1))
    with pytest.raises(InputError, match="2 sections, bha_nominal has 3"):
        motions_of(arm, [other])
    run = bha.simulate(arm, bha.Input.constant(np.full(9, 1.2e5), 0.1))
    with pytest.raises(InputError, match="at the same time"):
        motions_of(arm, [log, run])
    with pytest.raises(InputError, match="no rows"):
        motions_of(arm, [run[:0]])
    with pytest.raises(InputError, match="int is shown by nothing"):
        motions_of(arm, [3])  # type: ignore[list-item]
    with pytest.raises(LogError, match=r"no\.npz: there is no such file"):
        motions_of(arm, [tmp_path / "no.npz"])
    (tmp_path / "bad.npz").write_bytes(b"PK but no archive")
    with pytest.raises(LogError, match="no trajectory that bha wrote"):
        motions_of(arm, [tmp_path / "bad.npz"])
    np.savez(tmp_path / "other.npz", time=np.zeros(3))
    with pytest.raises(LogError, match="no trajectory that bha wrote"):
        motions_of(arm, [tmp_path / "other.npz"])


def test_a_part_is_as_the_whole_within_its_time(log: bha.Log) -> None:
    whole = motions_of(made.arm(), [log, bha.simulate(made.arm(), log)])
    cut = part(whole, 0.503, 1.2)
    for before, after in zip(whole, cut, strict=True):
        assert (after.time[0], after.time[-1]) == (100.503, 101.2)
        for time in (100.503, 100.8, 101.2):
            np.testing.assert_allclose(after.at(time).lengths, before.at(time).lengths, atol=1e-12)
            np.testing.assert_allclose(after.at(time).heads, before.at(time).heads, atol=1e-12)
    assert cut[0].measured is not None
    assert (cut[0].measured.time[0], cut[0].measured.time[-1]) == (pytest.approx(100.52), pytest.approx(101.2))
    assert part(whole) == whole
    assert part(whole, start=1.5)[0].time[-1] == 102.0
    assert part(whole, end=0.0)[0].time.tolist() == [100.0]
    for start, end in ((3.0, None), (1.0, 0.5), (None, -1.0)):
        with pytest.raises(InputError, match=r"nothing from .*; it lasts 2 s"):
            part(whole, start, end)


def test_small_gaps_are_drawn_longer() -> None:
    time, heads = np.array([0.0, 1.0]), np.zeros((2, 1, 3))
    lengths = np.full((2, 3), 0.2)

    def of(gap: float) -> int:
        measured = Measured(time, heads + np.array([gap, 0.0, 0.0]))
        return magnification([Motion("m", time, lengths, lengths, heads, measured)], 1.0)

    assert [of(gap) for gap in (1e-9, 1e-3, 6e-3, 0.2)] == [100, 50, 5, 1]
    assert magnification([], 1.0) == 1
    assert drawn_gap(1.0) == "gap to scale"
    assert drawn_gap(5.0) == "gap drawn 5 times"
    assert MAGNIFICATIONS[0] == 1


def test_the_clock_runs_repeats_and_stops(log: bha.Log) -> None:
    show = Show(made.arm(), motions_of(made.arm(), [log]))
    assert (show.start, show.end, show.time, show.live) == (100.0, 102.0, 100.0, False)
    assert not show.advance(1.0)
    show.playing, show.speed = True, 2.0
    assert show.advance(0.25)
    assert show.time == pytest.approx(100.5)
    show.advance(1.0)
    assert (show.time, show.playing) == (100.0, True)
    show.repeat = False
    show.advance(3.0)
    assert (show.time, show.playing) == (102.0, False)
    show.go_to(0.0)
    assert show.time == 100.0


def test_a_live_arm_goes_on_from_what_is_shown_and_comes_to_rest_under_its_commands(log: bha.Log) -> None:
    arm = made.arm()
    show = Show(arm, motions_of(arm, [log]))
    show.go_to(101.0)
    (before,) = show.moments()
    show.go_live()
    (after,) = show.moments()
    np.testing.assert_array_equal(after.lengths, before.lengths)
    np.testing.assert_allclose(after.pressures, before.pressures)
    assert np.isnan(after.measured).all()
    commands = np.linspace(1.1e5, 1.4e5, 9)
    show.command(commands)
    moved = [show.advance(0.1) for _ in range(200)]
    assert moved[0]
    assert not moved[-1]  # nothing left to be drawn
    (rest,) = show.moments()
    np.testing.assert_allclose(rest.lengths, arm.static_lengths(commands), atol=1e-5)
    np.testing.assert_allclose(rest.heads, arm.forward_kinematics(rest.lengths)[0])
    show.go_back()
    assert show.moments()[0].lengths == pytest.approx(before.lengths)


def test_after_a_live_arm_has_diverged_it_begins_again(log: bha.Log) -> None:
    show = Show(made.arm(), motions_of(made.arm(), [log]))
    show.go_live()
    show.command(np.full(9, 2e5))
    show.recover()
    assert not show.live
    assert show.commands.tolist() == show.relaxed.tolist() == [101325.0] * 9
    alone = Show(made.arm())
    alone.command(np.full(9, 2e5))
    alone.recover()
    assert alone.live
    np.testing.assert_allclose(alone.moments()[0].lengths, made.arm().static_lengths(alone.relaxed))


def test_an_arm_alone_is_live() -> None:
    arm = made.arm()
    show = Show(arm)
    assert show.live
    np.testing.assert_allclose(show.moments()[0].lengths, arm.static_lengths(show.commands))
    with pytest.raises(InputError, match="nothing is recorded"):
        show.go_back()
    with pytest.raises(InputError, match="p12 is -1 Pa"):
        show.command([1e5, -1.0, *[1e5] * 7])
    with pytest.raises(InputError, match="pressures"):
        show.command([1e5])


def test_colours_run_over_the_permitted_pressures() -> None:
    scale = PressureScale.of(made.arm())
    assert (scale.low, scale.high) == (0.7e5, 2.2e5)
    low, high, beyond, unknown = scale.colors([0.7e5, 2.2e5, 9e5, np.nan])
    assert low.tolist() == [68, 1, 84]  # viridis, as matplotlib's documentation has it
    assert high.tolist() == beyond.tolist() == [253, 231, 37]
    assert tuple(unknown) == UNKNOWN
    assert linear_light([0, 255, 188, 10]).tolist() == [0, 255, 128, 1]  # IEC 61966-2-1


def test_times_of_pictures() -> None:
    np.testing.assert_allclose(picture_times(100.0, 101.0, rate=4.0, speed=1.0), [100.0, 100.25, 100.5, 100.75, 101.0])
    np.testing.assert_allclose(picture_times(0.0, 10.0, rate=2.0, speed=5.0), [0.0, 2.5, 5.0, 7.5, 10.0])
    assert picture_times(3.0, 3.0, rate=25.0, speed=1.0).tolist() == [3.0]
    with pytest.raises(InputError, match=r"360 s are 9001 pictures, at most 5000 .* \(speed 1.8\)"):
        picture_times(0.0, 360.0, rate=25.0, speed=1.0, most=5000)
    assert len(picture_times(0.0, 360.0, rate=25.0, speed=1.8, most=5001)) == 5001
    for rate, speed in ((0.0, 1.0), (25.0, -1.0), (np.nan, 1.0), (25.0, np.inf)):
        with pytest.raises(InputError, match="above 0"):
            picture_times(0.0, 1.0, rate=rate, speed=speed)
