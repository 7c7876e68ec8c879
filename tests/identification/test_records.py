from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.estimation.records import some_of, windows
from bha.identification import record
from bha.logs import Log

from .identify_logs import measured, multisine, one_section


def test_channels_and_noise() -> None:
    arm = one_section()
    log = measured(arm, multisine(arm, 4.0, 200.0, 0), heads=True)
    rec = record(arm, log)
    assert rec.channels == ("q11", "q12", "q13", "x1", "y1", "z1")
    assert rec.noise == pytest.approx(3e-4, rel=0.2)
    assert rec.pressure_noise == pytest.approx(100.0, rel=0.2)
    only = record(arm, log, channels=["z1"])
    assert only.channels == ("z1",)
    heads = np.arange(3.0).reshape(1, 1, 3)
    assert only.observation.predicted(np.zeros((1, 3)), heads).tolist() == [[2.0]]


def test_windows_are_even_and_cover_everything() -> None:
    arm = one_section()
    recs = [record(arm, measured(arm, multisine(arm, t, 100.0, 0))) for t in (4.0, 1.3)]
    pieces = windows(recs, 1.0)
    assert [(w.record, w.first) for w in pieces] == [(0, 0), (0, 100), (0, 200), (0, 300), (1, 0)]
    assert [w.last for w in pieces] == [100, 200, 300, 401, 131]
    assert windows(recs, None)[0].last == 401
    assert len(some_of(pieces, recs, 2.0)) == 2


def test_thinning_keeps_the_drive() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, multisine(arm, 2.0, 200.0, 0)))
    thin = rec.thinned(0.02)
    assert len(thin) == 101
    assert len(thin.drive.time) == 401


def test_frozen_pressures() -> None:
    arm = one_section()
    log = measured(arm, multisine(arm, 10.0, 100.0, 0))
    values = {name: np.array(log[name]) for name in log.columns}
    inside = (values["t"] > 4.0) & (values["t"] < 8.0)
    for name in arm.inputs:
        values[name][inside] = values[name][np.argmax(inside)]
    frozen = Log.from_arrays({f"{n} [{log.units[n]}]": v for n, v in values.items()})
    rec = record(arm, frozen)
    # The arm takes a while to forget what it did meanwhile.
    assert not rec.usable[(rec.time > 4.1) & (rec.time < 8.9)].any()
    assert rec.usable[(rec.time < 3.9) | (rec.time > 9.1)].all()
    assert record(arm, log).usable.all()


def test_nothing_to_compare() -> None:
    arm = one_section()
    log = Log.from_arrays({"t [s]": [0.0, 1.0], **{f"{n} [Pa]": [1e5, 1e5] for n in arm.inputs}})
    with pytest.raises(bha.InputError, match="nothing to compare"):
        record(arm, log)


def test_missing_pressure() -> None:
    arm = one_section()
    log = Log.from_arrays({"t [s]": [0.0, 1.0], "q11 [m]": [0.1, 0.1], "p11 [Pa]": [1e5, 1e5]})
    with pytest.raises(bha.LogError, match="p12"):
        record(arm, log)


def test_unknown_channel() -> None:
    arm = one_section()
    log = measured(arm, multisine(arm, 1.0, 100.0, 0))
    with pytest.raises(bha.InputError, match="x3"):
        record(arm, log, channels=["x3"])
