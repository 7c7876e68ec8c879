"""Run the whole: generate, call the product on every case, score. Resumable: every step skips what is there.

Folders under ``out``: ``cases/<case>/`` (all the product ever gets), ``commitments/`` and ``commitments.txt``,
``results/<case>/``. The answers and the plan lie in ``<out>.sealed``, and the product is called with the paths of its
own case only.
"""

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

from .cases import FILES, CaseSpec, read_specs, write_case, write_specs
from .integrate import DivergedError
from .plan import build_plan
from .scoring import Score, read_verdict, report, score_cases
from .sealing import ANSWER, unseal, write_list, write_whole

RETRIES = 5
# A case whose arm cannot carry its effects is drawn again from a seed this far away.
SEED_STEP = 500_000


@dataclass(frozen=True)
class Folders:
    """Where everything of a run lies."""

    out: Path

    @property
    def cases(self) -> Path:
        """What the product may read."""
        return self.out / "cases"

    @property
    def commitments(self) -> Path:
        """Published hashes."""
        return self.out / "commitments"

    @property
    def results(self) -> Path:
        """What the product writes."""
        return self.out / "results"

    @property
    def sealed(self) -> Path:
        """Answers, beside ``out`` and not below it."""
        return self.out.with_name(self.out.name + ".sealed")


def say(text: str) -> None:
    """One line of progress."""
    print(text, file=sys.stderr, flush=True)


def plan_for(folders: Folders, seed: int, subset: str, count: int | None) -> list[CaseSpec]:
    """The plan of this run, kept with the sealed answers so that a resumed run does the same."""
    path = folders.sealed / f"plan_{seed}.json"
    if not path.exists():
        write_specs(build_plan(seed), path)
    specs = [s for s in read_specs(path) if subset in ("all", s.subset)]
    return specs if count is None else specs[:count]


def generate_one(spec: CaseSpec, folders: Folders) -> str:
    """Write one case, from another seed when its arm diverges."""
    begin = time.perf_counter()
    for attempt in range(RETRIES):
        try:
            answer = write_case(
                replace(spec, seed=spec.seed + attempt * SEED_STEP),
                folders.cases / spec.case,
                folders.sealed,
                folders.commitments,
            )
        except DivergedError as error:
            reason = str(error)
            continue
        gap = answer["gap_over_noise"]
        held = "-" if gap["holdout"] is None else f"{gap['holdout']:.1f}"
        return f"{spec.case}: gap {gap['train']:.1f} (held out {held}) x noise, {time.perf_counter() - begin:.0f} s"
    return f"{spec.case}: not generated, {reason}"


def _parallel(
    jobs: int, tasks: Sequence[tuple[CaseSpec, Folders]], pool: type, work: Callable[[CaseSpec, Folders], str]
) -> None:
    with pool(max_workers=jobs) as executor:
        futures = [executor.submit(work, *task) for task in tasks]
        try:
            for number, future in enumerate(as_completed(futures), 1):
                say(f"[{number}/{len(futures)}] {future.result()}")
        except KeyboardInterrupt:
            executor.shutdown(wait=False, cancel_futures=True)
            raise


def generate(folders: Folders, specs: list[CaseSpec], jobs: int) -> None:
    """Write all cases that are not there yet, then the list of commitments."""
    todo = [s for s in specs if not (folders.cases / s.case / "arm.toml").exists()]
    say(f"generate: {len(specs) - len(todo)} of {len(specs)} cases are there")
    if todo:
        # The first case alone: it compiles, the others then find the machine code on disk.
        say(f"[first] {generate_one(todo[0], folders)}")
        _parallel(jobs, [(s, folders) for s in todo[1:]], ProcessPoolExecutor, generate_one)
    number = write_list(folders.commitments, folders.out / "commitments.txt")
    say(f"{number} commitments in {folders.out / 'commitments.txt'}")


class Diagnose:
    """Call the product on a case by a command template.

    The template is split like a shell line; ``{arm}`` and ``{out}`` are replaced within words, the words ``{train}``
    and ``{holdout}`` by one word a file. No shell is involved.
    """

    def __init__(self, template: str, timeout: float) -> None:
        """Check the template once."""
        self.words = shlex.split(template)
        self.timeout = timeout
        missing = [x for x in ("{arm}", "{train}", "{out}") if not any(x in w for w in self.words)]
        if missing:
            raise ValueError(f"the command template lacks {', '.join(missing)}")

    def command(self, case: Path, out: Path) -> list[str]:
        """The command for one case."""
        train = [str(case / name) for name in FILES.values()]
        holdout = [str(case / f"holdout_{k}.csv") for k in (1, 2)]
        words: list[str] = []
        for word in self.words:
            if word == "{train}":
                words += train
            elif word == "{holdout}":
                # The option before the files is repeated before each of them.
                option = words.pop() if words and words[-1].startswith("-") else None
                for path in holdout:
                    words += [option, path] if option else [path]
            else:
                words.append(word.replace("{arm}", str(case / "arm.toml")).replace("{out}", str(out)))
        return words

    def __call__(self, spec: CaseSpec, folders: Folders) -> str:
        """Run the product; its output goes to ``product.log`` beside the result."""
        out = folders.results / spec.case
        out.mkdir(parents=True, exist_ok=True)
        begin = time.perf_counter()
        with (out / "product.log").open("wb") as log:
            try:
                done = subprocess.run(
                    self.command(folders.cases / spec.case, out),
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    timeout=self.timeout,
                    check=False,
                )
                state = "" if done.returncode == 0 else f", exit code {done.returncode}"
            except subprocess.TimeoutExpired:
                state = f", stopped after {self.timeout:.0f} s"
        verdict = read_verdict(out / "diagnosis.json")
        return f"{spec.case}: {verdict.first}{state}, {time.perf_counter() - begin:.0f} s"


def diagnose(folders: Folders, specs: list[CaseSpec], template: str, jobs: int, timeout: float) -> None:
    """Call the product on all cases without a ``diagnosis.json``."""
    call = Diagnose(template, timeout)
    ready = [s for s in specs if (folders.cases / s.case / "arm.toml").exists()]
    todo = [s for s in ready if not (folders.results / s.case / "diagnosis.json").exists()]
    say(f"diagnose: {len(ready) - len(todo)} of {len(ready)} cases are done")
    _parallel(jobs, [(s, folders) for s in todo], ThreadPoolExecutor, call)


def score(folders: Folders, specs: list[CaseSpec]) -> dict[str, Score]:
    """Unseal, check every commitment, score by subset, and write ``score_<subset>.md``."""
    scores = {}
    for subset in sorted({s.subset for s in specs}):
        cases = [s.case for s in specs if s.subset == subset and (folders.sealed / s.case / ANSWER).exists()]
        pairs = (
            (unseal(case, folders.sealed, folders.commitments), read_verdict(folders.results / case / "diagnosis.json"))
            for case in cases
        )
        scores[subset] = score_cases(pairs)
        text = report(scores[subset], f"Blind test, {subset} set: {len(cases)} cases")
        write_whole(folders.out / f"score_{subset}.md", text)
        print(text)
    return scores


def default_jobs() -> int:
    """Processes to use when nothing is said."""
    return max(1, min(2, os.cpu_count() or 1))
