"""Command line: ``python -m blindgen generate | diagnose | identify | score | all | case``.

``--world wide`` takes the wide world; ``identify`` and the subset ``quick`` are its own.
"""

import argparse
import sys
from pathlib import Path

from .cases import make_case
from .effects import EFFECTS
from .integrate import DivergedError
from .runner import Folders, default_jobs, diagnose, generate, plan_for, score
from .sealing import SealError
from .wide import runner as wide
from .wide.adapt import LACKS

PRODUCT = "bha diagnose {arm} {train} --holdout {holdout} --out {out}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="blindgen", description="Blind test of the diagnosis workflow.")
    commands = parser.add_subparsers(dest="command", required=True)
    for name, text in (
        ("generate", "write the cases of the plan"),
        ("diagnose", "call the product on every case"),
        ("identify", "call the product's identification on every case (wide world)"),
        ("score", "compare with the sealed answers"),
        ("all", "generate, diagnose (wide world: and identify), score"),
    ):
        sub = commands.add_parser(name, help=text)
        sub.add_argument("--world", choices=("first", "wide"), default="first")
        sub.add_argument("--out", type=Path, default=Path("out/blind"), help="folder of the run")
        sub.add_argument("--seed", type=int, default=1, help="seed of the plan")
        sub.add_argument("--subset", choices=("tune", "report", "quick", "all"), default="tune")
        sub.add_argument("--cases", type=int, default=None, metavar="N", help="only the first N of the subset")
        sub.add_argument("--jobs", type=int, default=default_jobs())
        if name in ("diagnose", "identify", "all"):
            default = wide.PRODUCTS["identify"] if name == "identify" else PRODUCT
            sub.add_argument("--product", default=None, help=f"command template, default: {default!r}")
            sub.add_argument(
                "--timeout", type=float, default=900.0, help="seconds for one case (wide: of processor time)"
            )
            sub.add_argument("--lacks", choices=LACKS, action="append", default=[], help="what the product cannot read")
    one = commands.add_parser("case", help="write one single-effect case")
    one.add_argument("--seed", type=int, required=True)
    one.add_argument("--case", required=True, choices=("null", *sorted(EFFECTS)), metavar="KIND")
    one.add_argument("--where", default=None)
    one.add_argument("--strength", type=float, default=1.0, help="multiple of the typical amplitude")
    one.add_argument("--gap", type=float, default=None, help="wanted gap over the noise, instead of the strength")
    one.add_argument("--noise", choices=("standard", "hard"), default="standard")
    one.add_argument("--duration", type=float, default=1.0, help="factor on the length of the logs")
    one.add_argument("--heads", action="store_true", help="measure head positions too")
    one.add_argument("--out", type=Path, required=True)
    return parser


def _first(options: argparse.Namespace) -> None:
    """Run a command of the first world."""
    if options.command == "identify" or options.subset == "quick":
        raise ValueError("identify and the subset quick belong to the wide world: add --world wide")
    folders = Folders(options.out.resolve())
    specs = plan_for(folders, options.seed, options.subset, options.cases)
    if options.command in ("generate", "all"):
        generate(folders, specs, options.jobs)
    if options.command in ("diagnose", "all"):
        diagnose(folders, specs, options.product or PRODUCT, options.jobs, options.timeout)
    if options.command in ("score", "all"):
        score(folders, specs)


def _wide(options: argparse.Namespace) -> None:
    """Run a command of the wide world; a template of one's own serves one task, not ``all``."""
    if options.subset == "all":
        raise ValueError("the wide world takes one subset at a time: tune, report or quick")
    folders = Folders(options.out.resolve())
    specs = wide.plan_for(folders, options.seed, options.subset, options.cases)
    if options.command in ("generate", "all"):
        wide.generate(folders, specs, options.jobs)
    for task in wide.TASKS:
        if options.command in (task, "all"):
            own = options.product if options.command == task else None
            product = wide.Product(task, own or wide.PRODUCTS[task], options.timeout, tuple(options.lacks))
            wide.call(folders, specs, product, options.jobs)
        if options.command in ("score", "all"):
            wide.score(folders, specs, task)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        if options.command == "case":
            make_case(
                options.seed,
                options.case,
                options.where,
                options.strength,
                options.noise,
                options.out,
                target_gap=options.gap,
                duration_factor=options.duration,
                heads=options.heads,
            )
            return 0
        (_wide if options.world == "wide" else _first)(options)
    except (ValueError, DivergedError, SealError, OSError) as error:
        print(f"blindgen: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("blindgen: interrupted; what is finished stays, the same command goes on from there", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
