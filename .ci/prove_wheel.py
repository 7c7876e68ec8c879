"""Prove a wheel outside of the checkout, and time the path of someone who has just heard of it.

In an empty environment the wheel installs with its base dependencies, says what is missing, simulates. In a second one
it installs with every extra; every command has its help; the README's snippets run; a newcomer's commands lead from a
tape measure to a diagnosis and a controlled arm. Each step is printed with its seconds: by the clock, and of processors
(nothing on Windows), which say more where the machine has other work.

usage: prove_wheel.py FOLDER_WITH_ONE_WHEEL
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

BASE = """\
import bha
arm = bha.robots.load("bha_nominal")
rows = [["t [s]", *(f"{name} [bar]" for name in arm.inputs)], [0, *[1.2] * 9], [0.1, *[1.5] * 9], [1, *[1.5] * 9]]
with open("step.csv", "w", encoding="utf-8") as file:
    file.write("".join(",".join(map(str, row)) + "\\n" for row in rows))
trajectory = bha.simulate(arm, bha.Log.read("step.csv"))
trajectory.write("trajectory.csv")
try:
    trajectory.write("trajectory.parquet")
except bha.MissingExtraError as error:
    assert "bha[parquet]" in str(error), error
else:
    raise AssertionError("pyarrow is there: the environment was not empty")
assert len(bha.Log.read("trajectory.csv")) > 1
"""

HELP = """\
import click
from click.testing import CliRunner
from bha.cli import main

def walk(command, words, context):
    answer = CliRunner().invoke(main, [*words, "--help"])
    assert answer.exit_code == 0 and "Usage:" in answer.output, (words, answer.output)
    count = 1
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            count += walk(command.get_command(context, name), [*words, name], context)
    return count

count = walk(main, [], click.Context(main))
assert count > 10, count
"""

#: From a tape measure on: an arm's file, what to command; then the arm on the bench, which the newcomer's file misses
#: in length and mass, plays the commands; its logs are checked, identified and diagnosed, and the arm follows a circle.
MEASURES = "--radius 50mm --diameter 40mm --pressure-max 1.5bar --length 200mm"
NEWCOMER = f"""\
bha robots
bha new my_arm {MEASURES} --longest 300mm --mass 0.5kg
bha info my_arm.toml
bha excite my_arm.toml --duration 10 --rate 100 --seed 1 --out command1.csv
bha excite my_arm.toml --duration 10 --rate 100 --seed 2 --out command2.csv
bha new bench {MEASURES} --longest 290mm --mass 0.58kg
bha simulate bench.toml --input command1.csv --dt 0.01 --out log1.csv --plot
bha simulate bench.toml --input command2.csv --dt 0.01 --out log2.csv
bha check my_arm.toml log1.csv log2.csv
bha identify my_arm.toml log1.csv --holdout log2.csv --out identified.toml --plot
bha diagnose identified.toml log1.csv --holdout log2.csv --out diagnosis
bha control identified.toml --controller pid --controller full --plot circle.svg
"""
#: What is there at the end.
WRITTEN = ("log1_shape.png", "identified.toml", "diagnosis/report.html", "circle.svg")


class Environment:
    """An empty environment and a folder, both away from the checkout; steps are printed with their seconds."""

    def __init__(self, folder: Path) -> None:
        """In a folder that is there; nothing is made yet."""
        self.folder = folder
        self.scripts = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
        self.python = str(self.scripts / "python")
        self.variables = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
        self.variables["PATH"] = str(self.scripts) + os.pathsep + os.environ["PATH"]

    def create(self) -> None:
        """The environment, with a pip that knows dependency groups."""
        with timed("an empty environment"):
            venv.create(self.folder / "venv", with_pip=True)
            self.pip("pip>=25.1")

    def pip(self, *what: str) -> None:
        """Install; errors and nothing else are printed."""
        command = [self.python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *what]
        subprocess.run(command, check=True, env=self.variables, cwd=self.folder)

    def install(self, step: str, *what: str) -> None:
        """A timed step of installation."""
        with timed(step):
            self.pip(*what)

    def run(self, step: str, *command: str) -> None:
        """A timed step; what it printed is shown if it fails.

        Raises:
            SystemExit: it failed.
        """
        # Windows would look for it on the path of this process.
        program = shutil.which(command[0], path=self.variables["PATH"]) or command[0]
        with timed(step):
            done = subprocess.run(
                [program, *command[1:]],
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                env=self.variables,
                cwd=self.folder,
                check=False,
            )
        if done.returncode:
            sys.exit(f"prove_wheel: {shlex.join(command)} gave {done.returncode}\n{done.stdout}{done.stderr}")


@contextmanager
def timed(step: str) -> Iterator[None]:
    """A line of the table: seconds by the clock, seconds of processors that child processes used, what was done."""
    clock, before = time.perf_counter(), os.times()
    yield
    after = os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    print(f"{time.perf_counter() - clock:8.1f} {used:8.1f}  {step}", flush=True)


def one_wheel(folder: Path) -> Path:
    """The wheel in a folder.

    Raises:
        SystemExit: there is not exactly one, or it is not for every Python and, on Linux, for every distribution.
    """
    found = sorted(folder.resolve().glob("*.whl"))
    if len(found) != 1:
        sys.exit(f"prove_wheel: expected one wheel in {folder}, found {len(found)}")
    if "-abi3-" not in found[0].name or (sys.platform == "linux" and "-manylinux" not in found[0].name):
        sys.exit(f"prove_wheel: not an abi3 wheel, or not a manylinux one: {found[0].name}")
    return found[0]


def prove_base(wheel: Path, folder: Path) -> None:
    """With nothing but what the package cannot do without."""
    environment = Environment(folder)
    environment.create()
    environment.install("pip install bha", str(wheel))
    environment.run("bha --version", "bha", "--version")
    environment.run("a first simulation, CSV in and out", environment.python, "-c", BASE)


def prove_all(wheel: Path, folder: Path) -> None:
    """With every extra, all that a newcomer meets."""
    environment = Environment(folder)
    environment.create()
    environment.install("pip install 'bha[all]'", f"{wheel}[all]")
    environment.run("every command's --help", environment.python, "-c", HELP)
    with timed("... all of the newcomer's commands"):
        for line in NEWCOMER.splitlines():
            environment.run(line, *shlex.split(line))
    missing = [name for name in WRITTEN if not (folder / name).is_file()]
    if missing:
        sys.exit(f"prove_wheel: {', '.join(missing)} not written; there is {sorted(p.name for p in folder.iterdir())}")
    environment.install("what runs the README's snippets", "--group", f"{ROOT / 'pyproject.toml'}:test")
    tests = [str(ROOT / "tests" / "test_docs.py"), "-k", "README or start", "-p", "no:cacheprovider"]
    environment.run("the README's snippets", environment.python, "-m", "pytest", "--rootdir", str(ROOT), *tests)


def main() -> None:
    """Both environments, one after the other."""
    wheel = one_wheel(Path(sys.argv[1]))
    print("   clock processors, s")
    for prove in (prove_base, prove_all):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            prove(wheel, Path(folder).resolve())
    print(f"proved: {wheel}, {wheel.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
