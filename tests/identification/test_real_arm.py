"""The identified real arm against logs that took no part, where they are at hand; the example without logs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import bha
from bha.identification import predict, record

ROOT = Path(__file__).resolve().parents[2]
LOGS = ROOT.parent / "shared" / "data" / "asu"


@pytest.mark.skipif(not LOGS.is_dir(), reason="needs the logs of the real arm")
@pytest.mark.filterwarnings("ignore:.*wire1l:bha.LogWarning")
@pytest.mark.parametrize("log", ["jan10_both_2", "jan10_right_3"])
def test_january_is_predicted_within_12_mm(log: str) -> None:
    arm = bha.robots.load("asu_two_section_january")
    (held,) = predict(arm, [record(arm, bha.Log.read(LOGS / f"{log}.csv"))])
    assert held.failed is None
    assert held.head_rms[2] < 0.012


@pytest.mark.parametrize("name", ["asu_two_section_january", "asu_two_section_april"])
def test_files_say_where_their_values_come_from(name: str) -> None:
    for section in bha.robots.parameters(name).sections:
        damping = section.provenance["damping"]
        assert damping.status in ("identified", "assumed")  # not told by the logs alone
        assert damping.ci95[0] < section.damping <= damping.ci95[1]  # type: ignore[index, operator]
        assert all(len(log.sha256) == 64 for log in damping.logs)


def test_the_example_skips_where_logs_are_missing(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "examples" / "identify_real_arm.py"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "nothing to do" in done.stdout
