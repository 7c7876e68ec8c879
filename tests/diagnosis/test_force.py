"""The residual force: found within its band, followed by the right variable, carried by a simulation."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

import bha
from bha.cli import main
from bha.diagnosis import ResidualTable
from bha.diagnosis.force import Lever, ResidualForce, estimated, residual_force
from bha.diagnosis.force_law import follow
from bha.diagnosis.force_smoother import Forces, Motion, smooth
from bha.diagnosis.force_summary import hidden_of
from bha.diagnosis.force_table import NO_CAUSE, Bellows, Curve
from bha.diagnosis.result import ForceAlong
from bha.diagnosis.written import remove_outdated
from bha.errors import InputError
from bha.estimation.records import Record

from .synthetic import SAMPLE_TIME, make_logs, observation, one_section, pressures, record_of

Array = NDArray[np.float64]
NOISE, PRESSURE_NOISE = 2e-4, 200.0


def hidden_runs(force: str, heads: tuple[str, ...] = ()) -> tuple[list[Record], list[tuple[Array, Array]]]:
    """Two logs of an arm with a force that is in no catalogue, and its true lengths and rates."""
    arm = one_section().with_effects([{"kind": "formula", "where": "section 1", "force": force}])
    records, motions = [], []
    for number, kind in enumerate(("steps", "multisine")):
        rng = np.random.default_rng([5, number])
        time = np.arange(1201) * SAMPLE_TIME
        p = pressures(time, kind, rng)
        run = bha.simulate(arm, bha.Input(time, p), times=time, options=bha.Options(method="rk4", step=1e-3))
        outputs = run.lengths
        if heads:
            outputs = run.head_positions[:, 0][:, ["xyz".index(name[0]) for name in heads]]
        measured = outputs + NOISE * rng.standard_normal(outputs.shape)
        record = record_of(time, measured, p + PRESSURE_NOISE * rng.standard_normal(p.shape), NOISE, PRESSURE_NOISE)
        records.append(replace(record, observation=observation(*heads)) if heads else record)
        motions.append((np.asarray(run.lengths), np.asarray(run.velocities)))
    return records, motions


def errors_of(found: ResidualForce, records: list[Record], truth: list[Array]) -> tuple[Array, Array]:
    """Errors and their standard deviations, all logs one after the other."""
    errors, deviations = [], []
    for k, record in enumerate(records):
        rows = np.searchsorted(record.time, found.of_log(found.time, k) - 1e-9)
        errors.append(found.of_log(found.force, k) - truth[k][rows])
        deviations.append(found.of_log(found.deviation, k))
    return np.concatenate(errors), np.concatenate(deviations)


@pytest.mark.parametrize(
    ("force", "law", "variable"),
    [
        ("-4e5 * pow(q - 0.16, 3)", lambda q, qd: -4e5 * (q - 0.16) ** 3 + 0.0 * qd, "q"),
        ("-40 * max(qd, 0)", lambda q, qd: -40.0 * np.maximum(qd, 0.0) + 0.0 * q, "qd"),
    ],
)
def test_a_force_in_no_catalogue_is_found_within_its_band(force: str, law: Any, variable: str) -> None:
    records, motions = hidden_runs(force)
    found = residual_force(one_section(), records, np.full(3, NOISE))
    truth = [law(q, qd) for q, qd in motions]
    errors, deviations = errors_of(found, records, truth)
    assert 0.92 < np.mean(np.abs(errors) < 1.96 * deviations) <= 1.0
    # A band that holds because it is wide says nothing: it is a tenth of the force or so.
    assert np.sqrt(np.mean(deviations**2)) < 0.2 * np.sqrt(np.mean(np.concatenate(truth) ** 2))
    assert np.all(found.told > 0.95)
    followed = follow(found, [0, 1])
    assert followed is not None
    assert followed.variables == (variable,)
    assert followed.explained > 0.85
    (table,) = followed.tables
    (curve,) = table.curves
    inner = np.array(curve.nodes[1:-1])
    want = law(inner, inner) if variable == "q" else law(0.0, inner)
    np.testing.assert_allclose(np.array(curve.force[1:-1]), want, atol=0.08 * np.ptp(curve.force))


def test_heads_tell_it_too_and_one_axis_of_a_head_does_not() -> None:
    records, motions = hidden_runs("-40 * max(qd, 0)", ("x1", "y1", "z1"))
    found = residual_force(one_section(), records, np.full(3, NOISE))
    errors, deviations = errors_of(found, records, [-40.0 * np.maximum(qd, 0.0) for _, qd in motions])
    assert np.mean(np.abs(errors) < 1.96 * deviations) > 0.9
    records, _ = hidden_runs("-40 * max(qd, 0)", ("z1",))
    assert np.all(residual_force(one_section(), records, np.full(1, NOISE)).told < 0.6)


def test_no_force_to_speak_of_is_told_and_a_wide_band_is_not() -> None:
    def line(name: str, rms: float, deviation: float, told: float) -> ForceAlong:
        return ForceAlong(name=name, where=name, rms=rms, deviation=deviation, told=told)

    lines = [line("f11", 1.4, 0.5, 0.93), line("f21", 0.06, 0.2, 0.3), line("f31", 1.0, 2.0, 0.3)]
    assert [found.name for found in hidden_of(lines)] == ["f31"]
    assert len(hidden_of(lines[1:])) == 2


def test_beside_memory_there_is_none_and_it_says_so() -> None:
    records, _ = hidden_runs("-40 * max(qd, 0)")
    arm = one_section().with_effects([{"kind": "creep", "where": "section 1", "stiffness": 100.0, "tau": 1.0}])
    assert estimated(arm, records, np.full(3, NOISE)) == (
        "the arm's file has effects whose forces remember the motion (creep at section 1)"
    )


def test_the_smoother_gives_what_the_joint_distribution_does() -> None:
    rng = np.random.default_rng(2)
    count, n, m, channels = 6, 3, 2, 2
    step, time = 0.1, 0.4
    shape = (count - 1, 1)
    motion = Motion(
        transitions=0.5 * rng.standard_normal((*shape, n, n)),
        offsets=rng.standard_normal((*shape, n)),
        now=rng.standard_normal((*shape, n, m)),
        later=rng.standard_normal((*shape, n, m)),
        added=np.broadcast_to(0.01 * np.eye(n), (*shape, n, n)),
        shown=rng.standard_normal((count, 1, channels, n)),
        read=rng.standard_normal((count, 1, channels)),
        noise=np.full((count, 1, channels), 0.3),
        start=rng.standard_normal((1, n)),
        spread=np.full(n, 0.7),
        step=step,
        lasts=np.array([count]),
    )
    sizes = np.array([0.8, 1.7])
    found = smooth(motion, Forces(sizes, time))
    # The whole as one normal vector: start, forces of all rows, what is added.
    keep = np.exp(-step / time)
    lags = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    forces = np.kron(keep**lags, np.diag(sizes**2))
    prior = np.zeros((n + count * m + (count - 1) * n,) * 2)
    prior[:n, :n] = 0.49 * np.eye(n)
    prior[n : n + count * m, n : n + count * m] = forces
    prior[n + count * m :, n + count * m :] = 0.01 * np.eye((count - 1) * n)
    mean, table = motion.start[0], np.hstack([np.eye(n), np.zeros((n, len(prior) - n))])
    means, tables = [mean], [table]
    for k in range(count - 1):
        f = motion.transitions[k, 0]
        mean, table = f @ mean + motion.offsets[k, 0], f @ table
        table[:, n + k * m : n + (k + 1) * m] += motion.now[k, 0]
        table[:, n + (k + 1) * m : n + (k + 2) * m] += motion.later[k, 0]
        table[:, n + count * m + k * n : n + count * m + (k + 1) * n] += np.eye(n)
        means.append(mean)
        tables.append(table)
    h = np.vstack([motion.shown[k, 0] @ tables[k] for k in range(count)])
    left = np.concatenate([motion.read[k, 0] - motion.shown[k, 0] @ means[k] for k in range(count)])
    gain = prior @ h.T @ np.linalg.inv(h @ prior @ h.T + 0.3 * np.eye(len(h)))
    posterior, covariance = gain @ left, prior - gain @ h @ prior
    np.testing.assert_allclose(found.forces[:, 0].ravel(), posterior[n : n + count * m], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        found.deviation[:, 0].ravel() ** 2, np.diag(covariance)[n : n + count * m], rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(found.motion[-1, 0], means[-1] + tables[-1] @ posterior, rtol=1e-9)
    moments = np.outer(posterior, posterior) + covariance
    own = moments[n : n + count * m, n : n + count * m].reshape(count, m, count, m)
    by_force = [sum(own[k, j, k, j] for k in range(count)) / count for j in range(m)]
    np.testing.assert_allclose(found.better.sizes**2, by_force, rtol=1e-9)
    weights = 1.0 / sizes**2
    neighbours = sum(own[k, j, k + 1, j] * weights[j] for k in range(count - 1) for j in range(m))
    alone = sum(own[k, j, k, j] * weights[j] for k in range(count - 1) for j in range(m))
    expected = -step / np.log(np.clip(neighbours / alone, np.exp(-0.5), np.exp(-step / (0.5 * count * step))))
    assert found.better.time == pytest.approx(expected, rel=1e-9)


def table_of(*curves: Curve, where: str = "bellows 12") -> ResidualTable:
    return ResidualTable(
        schema="bha-residual/1",
        arm="one_section",
        logs=["a.csv"],
        without=2e-3,
        error=1e-3,
        tables=[Bellows(where=where, curves=list(curves))],
    )


def test_an_arm_carries_the_table_as_the_force_of_its_bellows_and_holds_its_edges(tmp_path: Path) -> None:
    lengths = Curve(variable="q", nodes=[0.12, 0.15, 0.2], force=[3.0, -1.5, -7.25], deviation=[0.1, 0.1, 0.1])
    rates = Curve(variable="qd", nodes=[-0.2, 0.0, 0.3], force=[2.0, 0.0, -4.0], deviation=[0.1, 0.1, 0.1])
    table = table_of(lengths, rates)
    table.write(tmp_path / "table.toml")
    arm = one_section().with_effects([{"kind": "weak_bellows", "where": "bellows 11", "change": -0.1}])
    carried = ResidualTable.read(tmp_path / "table.toml").carried(arm)
    assert [e.kind for e in carried.parameters.effects] == ["weak_bellows", "formula", "formula"]
    assert NO_CAUSE in carried.name
    assert "held at its edges beyond" in table.in_words()
    lever = Lever(arm)
    for q, rate in ((0.11, -0.5), (0.13, -0.1), (0.18, 0.2), (0.24, 0.9)):
        pose, rates_of = np.array([0.16, q, 0.17]), np.array([0.0, rate, 0.1])
        want = np.interp(q, lengths.nodes, lengths.force) + np.interp(rate, rates.nodes, rates.force)
        # What does not depend on pressure stands in the bias force, with its sign turned.
        force = arm.bias_force(pose, rates_of) - carried.bias_force(pose, rates_of)
        np.testing.assert_allclose(force, lever.at(pose, rates_of)[:, 1] * want, rtol=1e-6, atol=1e-9)


def test_what_is_no_table_is_refused_with_its_reason(tmp_path: Path) -> None:
    path = tmp_path / "table.toml"
    with pytest.raises(InputError, match=r"table\.toml: cannot be read"):
        ResidualTable.read(path)
    path.write_text("log,t [s]\na,0\n")
    with pytest.raises(InputError, match=r"no residual table: .*residual_table\.toml of bha diagnose is needed"):
        ResidualTable.read(path)
    path.write_text('schema = "bha-residual/1"\narm = "x"\n')
    with pytest.raises(InputError, match="no residual table: logs: Field required"):
        ResidualTable.read(path)
    with pytest.raises(ValueError, match="numbers that do not ascend"):
        Curve(variable="q", nodes=[0.2, 0.1], force=[0.0, 0.0], deviation=[0.0, 0.0])
    good = Curve(variable="q", nodes=[0.1, 0.2], force=[0.0, 1.0], deviation=[0.0, 0.0])
    with pytest.raises(InputError, match="the residual table of one_section does not fit the arm one_section"):
        table_of(good, where="bellows 42").carried(one_section())


def test_what_nothing_explains_ends_as_a_force_and_a_table_that_predicts_better(tmp_path: Path) -> None:
    hidden = {"kind": "formula", "where": "section 1", "parameters": {"force": "-60 * max(qd, 0)"}}
    logs = make_logs(one_section(), [hidden], seed=3, durations=(5.0, 5.0, 5.0))
    start = one_section({"mass": 0.93, "stiffness": 1.1, "rest_length": 0.9, "damping": 1.12})
    found = bha.diagnose(start, logs[:2], logs[2:], kinds=("weak_bellows",), out=tmp_path, report=False)
    assert found.verdict == "unexplained"
    assert found.residual_force is not None
    force, table = found.residual_force, found.residual_force.table
    assert table is not None
    assert force.file == "residual_force.csv"
    assert "qd" in table.variables
    assert table.before == found.gap.before
    assert "a correction, no cause" in force.reason
    assert bha.diagnosis.Diagnosis.model_validate_json(found.to_json()) == found
    again = found.model_copy(update={"residual_force": None})
    rows = np.genfromtxt(tmp_path / "residual_force.csv", delimiter=",", names=True, deletechars="", dtype=None)
    names = rows.dtype.names
    assert names is not None
    assert names[:5] == ("log", "t_[s]", "f11_[N]", "f11_low_[N]", "f11_high_[N]")
    # By the command, on a log that took no part: less error with the table than without.
    path = tmp_path / "held_out.csv"
    logs[2].write(path)
    command = ["simulate", str(tmp_path / "arm_diagnosed.toml"), "--input", str(path), "--json"]
    plain, carried = (
        json.loads(CliRunner().invoke(main, [*command, *more], catch_exceptions=False).stdout)
        for more in ([], ["--residual", str(tmp_path / "residual_table.toml")])
    )
    size = {
        name: np.sqrt(np.mean(np.square(list(result["output_error_rms"].values()))))
        for name, result in (("plain", plain), ("carried", carried))
    }
    assert size["carried"] < 0.7 * size["plain"]
    assert plain["notes"] == []
    assert "no cause" in carried["notes"][0]
    assert "no cause" in carried["arm"]
    # A diagnosis into the same folder that leaves none takes the old one away.
    remove_outdated(tmp_path, again)
    assert {path.name for path in tmp_path.iterdir()} == {"arm_diagnosed.toml", "diagnosis.json", "held_out.csv"}
