"""Without the optional packages: what needs none of them works, the rest says what to install."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[1] / "examples" / "tilt.csv"
#: The command with the packages of the extras hidden, as in an environment that has none.
HIDDEN = """\
import importlib.abc, sys

class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("scipy", "matplotlib", "plotly", "pyarrow", "pandas", "viser"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None

sys.meta_path.insert(0, Hidden())
from bha.cli import main
main(sys.argv[1:], prog_name="bha")
"""


def bha_alone(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", HIDDEN, *map(str, words)], capture_output=True, text=True, check=False)


def test_simulate_needs_no_optional_package(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    done = bha_alone("simulate", "bha_nominal", "--input", EXAMPLE, "--out", out)
    assert done.returncode == 0, done.stderr
    assert out.exists()


@pytest.mark.parametrize("command", ["check", "identify", "diagnose"])
def test_what_needs_scipy_says_so_without_a_traceback(command: str) -> None:
    done = bha_alone(command, "bha_nominal", EXAMPLE)
    assert done.returncode == 1
    assert "pip install 'bha[identify]'" in done.stderr
    assert "Traceback" not in done.stderr
