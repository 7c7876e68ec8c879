"""The paper's claims on the virtual arm, with shorter measurements than the document's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from bha.cli.experiment import EXPERIMENTS, experiment, function
from bha.experiments import Laboratory, fig8, fig10, fig11, fig14, table2, tilts
from bha.experiments.document import document, section
from bha.experiments.end_force_drift import free_swing, growth_rate, unstable_poses
from bha.experiments.laboratory import fit_bending
from bha.experiments.outcome import Outcome

pytest.importorskip("matplotlib")
pytest.importorskip("scipy")
ROOT = Path(__file__).resolve().parents[2]


def test_stiffness_and_table(laboratory: Laboratory) -> None:
    outcome = fig8.run(laboratory)
    assert all(claim.holds for claim in outcome.claims), outcome.claims
    tables = table2.run(laboratory).tables
    assert tables[0].rows[0] == ["mass per section [kg]", "0.75", "0.60", "0.45"]
    assert tables[0].rows[2][1] == "-81 to 309"  # 0.0026 m^2 between 0.7 and 2.2 bar


def test_bending_is_linear(laboratory: Laboratory) -> None:
    schedule, log = laboratory.measure_bending(3)
    fit = fit_bending(laboratory.paper.sprung, 3, log, schedule)
    assert 1 - np.var(fit.residual) / np.var(fit.ordinate) > 0.9
    assert np.ptp(fit.abscissa) > 1.0
    assert fit.coefficients[0] == pytest.approx(laboratory.design.parameters.sections[2].bending_stiffness[0], rel=0.3)


def test_swings(laboratory: Laboratory) -> None:
    damping = fig10.run(laboratory)
    assert all(claim.holds for claim in damping.claims), damping.claims
    assert 0.02 < damping.numbers["damping_ratio"] < 0.1
    energy = fig11.run(laboratory)
    assert energy.numbers["share"] < 0.25
    models = fig14.run(laboratory).numbers
    # Both models alike, whatever the virtual arm does.
    assert models["apart"] < 0.3 * models["amplitude"]
    # The paper's place of the mass is right for the arm that has it there, and for no other.
    assert abs(models["at_heads_full_frequency_off"]) < 0.05
    assert abs(models["full_frequency_off"]) > 0.08
    assert abs(models["spread_frequency_off"]) < 0.03


def test_tilts(laboratory: Laboratory) -> None:
    dynamic = tilts.fig12(laboratory).numbers
    assert dynamic["travel"] > 0.1
    assert dynamic["apart"] < 0.5 * dynamic["full_error"]
    static = tilts.fig13(laboratory).numbers
    assert static["at_heads_coupled_error"] > 1.5 * static["at_heads_full_error"]
    assert static["coupled_error"] > 1.5 * static["spread_error"]
    assert static["decoupled_error"] > static["coupled_error"]


def test_force_models_as_documented() -> None:
    _, energies = free_swing(1.0)
    assert np.ptp(energies["work_conjugate"]) < 1e-6 * energies["work_conjugate"][0]
    assert np.ptp(energies["end_force"]) > 0.1 * energies["end_force"][0]
    assert unstable_poses((9.81, 0.0, 0.0), "end_force", 40) > 0
    assert unstable_poses((9.81, 0.0, 0.0), "work_conjugate", 40) == 0


def test_growth_rate_of_a_hanging_arm_is_its_slowest_decay(laboratory: Laboratory) -> None:
    p = np.full(9, 1.3e5)
    arm = laboratory.design
    rate = growth_rate(arm, arm.static_lengths(p), p)
    assert -2.0 < rate < -0.1


def test_command(tmp_path: Path) -> None:
    result = CliRunner().invoke(experiment, ["end_force_drift", "--out", str(tmp_path), "--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert all(claim["holds"] for claim in found["end_force_drift"]["claims"]), found
    assert (tmp_path / "figures" / "end_force_drift.png").stat().st_size > 10_000
    assert CliRunner().invoke(experiment, ["fig7"]).exit_code == 2


def test_the_document_is_that_of_the_command(laboratory: Laboratory) -> None:
    written = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8")
    empty = document([], laboratory.real.body, laboratory.real.sensors)
    # Everything but the count of claims, which stands in the third paragraph.
    for paragraph in empty.split("\n\n")[3:]:
        assert paragraph.strip() in written
    for name in EXPERIMENTS:
        assert callable(function(name))
    for picture in sorted((ROOT / "docs" / "figures").glob("*.png")):
        documents = (ROOT / "docs").rglob("*.md")
        assert any(f"figures/{picture.name}" in path.read_text(encoding="utf-8") for path in documents), picture
    assert section(Outcome("x", "Title", "Text."))[0] == "## Title"
