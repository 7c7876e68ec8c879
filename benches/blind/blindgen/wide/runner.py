"""Run the wide world: make the cases, call the product, score. Every step skips what is there.

Folders as in the old world (:class:`blindgen.runner.Folders`); results of a task lie in ``results/<task>/<case>/``:
``diagnosis.json`` or what the command prints (``stdout.txt``), its messages (``product.log``) and how the call went
(``run.json``).
"""

import json
import os
import shlex
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ..runner import Folders, say
from ..sealing import ANSWER, unseal, write_list, write_whole
from . import identification, scoring
from .adapt import adapted
from .cases import write_case
from .integrate import DivergedError
from .plan import WideSpec, build_plan, read_plan, write_plan
from .scoring import Run, Trial
from .verdicts import read_said, with_refusal

RETRIES = 6
SEED_STEP = 500_000
PRODUCTS = {
    "diagnose": "bha diagnose {arm} {train} --holdout {holdout} {commanded} --out {out} --no-report --threads 1",
    "identify": "bha identify {arm} {train} --holdout {holdout} {commanded} --out {out}/arm_identified.toml --json",
}
TASKS = tuple(PRODUCTS)


def plan_for(folders: Folders, seed: int, subset: str, count: int | None) -> list[WideSpec]:
    """The plan of this run, kept with the sealed answers so that a resumed run does the same."""
    path = folders.sealed / f"wide_{subset}_{seed}.json"
    if not path.exists():
        write_plan(build_plan(seed, subset), path)
    specs = read_plan(path)
    return specs if count is None else specs[:count]


def generate_one(spec: WideSpec, folders: Folders) -> str:
    """Write one case, from another seed when its arm diverges."""
    begin = time.perf_counter()
    reason = ""
    for attempt in range(RETRIES):
        try:
            write_case(
                replace(spec, seed=spec.seed + attempt * SEED_STEP),
                folders.cases / spec.case,
                folders.sealed,
                folders.commitments,
            )
        except DivergedError as error:
            reason = str(error)
            continue
        return f"{spec.case}: {spec.total:.0f} s of logs made in {time.perf_counter() - begin:.0f} s"
    return f"{spec.case}: not made, {reason}"


def _all(executor: Any, work: Callable[..., str], tasks: Sequence[tuple[Any, ...]]) -> None:
    with executor:
        futures = [executor.submit(work, *task) for task in tasks]
        try:
            for number, future in enumerate(as_completed(futures), 1):
                say(f"[{number}/{len(futures)}] {future.result()}")
        except KeyboardInterrupt:
            executor.shutdown(wait=False, cancel_futures=True)
            raise


def generate(folders: Folders, specs: Sequence[WideSpec], jobs: int) -> None:
    """Write all cases that are not there yet, then the list of commitments."""
    todo = [s for s in specs if not (folders.cases / s.case / "arm.toml").exists()]
    say(f"generate: {len(specs) - len(todo)} of {len(specs)} cases are there")
    if todo:
        # The first case alone: it compiles, the others then find the machine code on disk.
        say(f"[first] {generate_one(todo[0], folders)}")
        _all(ProcessPoolExecutor(jobs), generate_one, [(s, folders) for s in todo[1:]])
    write_list(folders.commitments, folders.out / "commitments.txt")


def command(template: str, case: Path, out: Path) -> list[str]:
    """Words of the call for one case; no shell is involved.

    The word ``{train}`` becomes the training logs, ``{holdout}`` the held-out ones with the option before it repeated,
    ``{commanded}`` the option ``--pressures commanded`` where the logs hold commands alone; ``{arm}`` and ``{out}`` are
    replaced within words.
    """
    words: list[str] = []
    train, held = (sorted(case.glob(f"{kind}_*.csv")) for kind in ("train", "holdout"))
    with train[0].open(encoding="utf-8") as file:
        commanded = ",pc" in file.readline()
    for word in shlex.split(template):
        if word == "{train}":
            words += map(str, train)
        elif word == "{holdout}":
            option = [words.pop()] if words and words[-1].startswith("-") else []
            for path in held:
                words += [*option, str(path)]
        elif word == "{commanded}":
            words += ["--pressures", "commanded"] if commanded else []
        else:
            words.append(word.replace("{arm}", str(case / "arm.toml")).replace("{out}", str(out)))
    return words


@dataclass(frozen=True)
class Product:
    """A command and how it is called; ``timeout`` is processor time, in seconds."""

    task: str
    template: str
    timeout: float
    lacks: tuple[str, ...] = ()

    def __call__(self, spec: WideSpec, folders: Folders) -> str:
        """Run it on one case."""
        out = results(folders, self.task) / spec.case
        out.mkdir(parents=True, exist_ok=True)
        case = adapted(folders.cases / spec.case, out / "input", self.lacks)
        words = _limited(command(self.template, case, out), self.timeout)
        begin = time.perf_counter()
        with (out / "stdout.txt").open("wb") as printed, (out / "product.log").open("wb") as log:
            process = subprocess.Popen(words, stdout=printed, stderr=log)
            code, cpu = _wait(process)
        late = code is None
        said = (out / "product.log").read_text(encoding="utf-8", errors="replace")
        # Progress bars end in carriage returns.
        lines = [x.strip() for x in said.replace("\r", "\n").splitlines() if x.strip()]
        seconds = time.perf_counter() - begin
        traceback = "Traceback (most recent call last)" in said
        run = Run(round(seconds, 1), round(cpu, 1), code, late, traceback, (lines or [""])[-1][:300])
        write_whole(out / "run.json", json.dumps(asdict(run), indent=1) + "\n")
        state = f"stopped after {self.timeout:.0f} s" if late else f"exit code {code}"
        return f"{spec.case}: {state}, {seconds:.0f} s, {cpu:.0f} s of processor time"


def _limited(words: list[str], seconds: float) -> list[str]:
    """The same call, stopped after so much processor time: a machine that is shared makes no difference."""
    return ["sh", "-c", 'ulimit -t "$1"; shift; exec "$@"', "sh", str(max(1, round(seconds))), *words]


def _wait(process: subprocess.Popen[bytes]) -> tuple[int | None, float]:
    """Exit code of a process, None where its time was up, and its processor time in seconds."""
    _, status, usage = os.wait4(process.pid, 0)
    # The module must not wait for it again.
    process.returncode = os.waitstatus_to_exitcode(status)
    late = process.returncode in (-signal.SIGXCPU, -signal.SIGKILL)
    return (None if late else process.returncode), usage.ru_utime + usage.ru_stime


def results(folders: Folders, task: str) -> Path:
    """Where the results of a task lie."""
    return folders.results / task


def call(folders: Folders, specs: Sequence[WideSpec], product: Product, jobs: int) -> None:
    """Call the product on all cases that it was not called on yet."""
    ready = [s for s in specs if (folders.cases / s.case / "arm.toml").exists()]
    todo = [s for s in ready if not (results(folders, product.task) / s.case / "run.json").exists()]
    say(f"{product.task}: {len(ready) - len(todo)} of {len(ready)} cases are done")
    _all(ThreadPoolExecutor(jobs), product, [(s, folders) for s in todo])


def read_run(path: Path) -> Run:
    """How a call went; nothing where it is not known."""
    try:
        return Run(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return Run()


def _judged(folders: Folders, specs: Sequence[WideSpec], task: str) -> Iterator[tuple[dict[str, Any], Path, Run]]:
    """Answers (checked against their commitments), folders of results, and how the calls went."""
    for spec in specs:
        place = results(folders, task) / spec.case
        if (place / "run.json").exists() and (folders.sealed / spec.case / ANSWER).exists():
            yield unseal(spec.case, folders.sealed, folders.commitments), place, read_run(place / "run.json")


def score(folders: Folders, specs: Sequence[WideSpec], task: str) -> str:
    """Unseal, score, and write ``score_<task>_<subset>.md``; returns its text."""
    rows = list(_judged(folders, specs, task))
    title = f"Wide world, {specs[0].subset} set, {task}: {len(rows)} of {len(specs)} cases"
    if task == "diagnose":
        trials = [
            Trial(
                answer, with_refusal(read_said(place / "diagnosis.json"), "" if run.traceback else run.last_line), run
            )
            for answer, place, run in rows
        ]
        text = scoring.report(scoring.score_trials(trials), title)
    else:
        found = [(answer, identification.read_identified(place / "stdout.txt"), run) for answer, place, run in rows]
        text = identification.report(*identification.score_identifications(found), title)
    write_whole(folders.out / f"score_{task}_{specs[0].subset}.md", text)
    print(text)
    return text
