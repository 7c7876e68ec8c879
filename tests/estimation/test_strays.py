"""Readings far apart: what strays is told by a model, and what a wrong model leaves is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bha
from bha.estimation.records import Record, record
from bha.estimation.strays import in_words, strays, without_strays
from bha.identification import predict
from bha.logs import Log

from .slow_arm import TRUE, arm_of

ARM = arm_of(TRUE, apart=True)
#: Range of the pressures, Pa.
SWING = 5.8e4
#: Row and channel of what is put in, m: alone, two in a row, one beside another, the last but one.
PUT_IN = {(30, 0): 0.02, (60, 1): -0.015, (61, 1): 0.012, (90, 2): 0.011, (92, 2): -0.03, (238, 0): -0.02}


def ten_hertz(put_in: dict[tuple[int, int], float], interval: float = 0.1) -> Record:
    """24 s of steps; the tip with 0.3 mm of noise, and what is put in."""
    random = np.random.default_rng(5)
    time = np.arange(0.0, 24.0, interval)
    levels = random.uniform(0.0, SWING, (10, 4))
    pressures = 101325.0 + levels[(time / 2.5).astype(int)]
    run = bha.simulate(ARM, bha.Input(time, pressures), times=time, method="ros2", step=2e-3)
    tip = run.head_positions[:, 0] + 3e-4 * random.standard_normal((len(time), 3))
    columns = {"t [s]": time} | {f"p1{k + 1} [Pa]": p for k, p in enumerate(pressures.T)}
    tips = {f"{axis}1 [m]": x for axis, x in zip("xyz", tip.T, strict=True)}
    rec = record(ARM, Log.from_arrays(columns | tips), name="ten hertz")
    measured = rec.measured.copy()
    for place, size in put_in.items():
        measured[place] += size
    # Put in behind the search for spikes by their shape, which finds some of them, too.
    return replace(rec, measured=measured)


def shown(arm: bha.Arm, rec: Record) -> np.ndarray:
    """What an arm shows of a record."""
    return predict(arm, [rec])[0].predicted


def test_what_is_put_in_is_found_and_nothing_else() -> None:
    """Strays alone, in pairs and near the end; they do not count, and the notes say so."""
    rec = ten_hertz(PUT_IN)
    found = strays(rec, shown(ARM, rec))
    assert {(int(row), int(c)) for row, c in np.argwhere(found)} == set(PUT_IN)
    sound = without_strays([rec], [shown(ARM, rec)])[0]
    assert not np.any(sound.usable & found)
    assert "2 of x1" in in_words(rec, sound)
    assert in_words(rec, rec) == ""
    # Where nothing is shown nothing is told.
    assert not np.any(strays(rec, np.full(rec.measured.shape, np.nan)))


def test_noise_that_strays_have_made_hides_none() -> None:
    """Ten of 240 readings of a channel: what is told of noise before a fit has them in it."""
    put_in = {(17 + 22 * k, 0): 0.012 * (-1) ** k for k in range(10)}
    rec = ten_hertz(put_in)
    rec = rec.with_noise(np.array([2e-3, 3e-4, 3e-4]))
    found = strays(rec, shown(ARM, rec))
    assert {(int(row), int(c)) for row, c in np.argwhere(found)} == set(put_in)


@pytest.mark.parametrize(
    "wrong",
    [
        {"stiffness": 1.5 * TRUE["stiffness"]},
        {"damping": 0.3 * TRUE["damping"]},
        {"damping": 4.0 * TRUE["damping"]},
        {"terminal_area": 0.7 * TRUE["terminal_area"]},
    ],
)
def test_what_a_wrong_model_leaves_is_no_stray(wrong: dict[str, float]) -> None:
    """Steps leave jumps of centimetres, for several readings or in several channels."""
    rec = ten_hertz({})
    assert not np.any(strays(rec, shown(arm_of(TRUE | wrong, apart=True), rec)))


def test_a_late_model_leaves_none() -> None:
    """A dead time of less than a reading: each step leaves one reading far off, by as much as the arm moves."""
    rec = ten_hertz({})
    late = np.vstack([shown(ARM, rec)[:1], shown(ARM, rec)[:-1]])
    assert np.max(np.abs(rec.measured - late)) > 5e-3
    assert not np.any(strays(rec, late))


def test_what_all_channels_do_is_no_stray() -> None:
    """A knock on the arm moves the tip in all directions."""
    rec = ten_hertz({(50, c): 0.02 for c in range(3)})
    assert not np.any(strays(rec, shown(ARM, rec)))


def test_dense_readings_are_left_to_their_shape() -> None:
    """At fifty a second spikes show without a model."""
    rec = ten_hertz({(400, 0): 0.02}, 0.02)
    assert not np.any(strays(rec, shown(ARM, rec)))


def test_a_stray_as_the_arm_sets_out_lies_on_the_other_side() -> None:
    """Not as far as the arm then goes, the other way; what errs in time lies on the way."""
    rec = ten_hertz({})
    outputs = shown(ARM, rec)
    ahead = np.diff(outputs, axis=0)
    before, after = ahead[:-1], ahead[1:]
    row, c = np.unravel_index(np.argmax(np.abs(after) * (np.abs(before) < 0.2 * np.abs(after))), after.shape)
    row, way = int(row) + 1, float(after[row, c])
    assert abs(way) > 4e-3
    for size, told in ((-0.8 * way, True), (0.8 * way, False)):
        measured = rec.measured.copy()
        measured[row, c] += size
        put_in = replace(rec, measured=measured)
        found = {(int(r), int(k)) for r, k in np.argwhere(strays(put_in, outputs))}
        assert found == ({(row, int(c))} if told else set())


def test_without_strays_noise_is_that_of_what_is_left() -> None:
    """One reading of 20 mm among 240 makes a millimetre of noise."""
    rec = ten_hertz({(30, 0): 0.02})
    noisy = rec.with_noise(np.array([2e-3, 3e-4, 3e-4]))
    sound = without_strays([noisy], [shown(ARM, noisy)])[0]
    assert sound.noise[0] < 1.9e-3
    assert np.array_equal(sound.noise[1:], noisy.noise[1:])
