"""Command line: ``python -m blindgen generate | diagnose | score | all | case``."""

import argparse
import sys
from pathlib import Path

from .cases import make_case
from .effects import EFFECTS
from .integrate import DivergedError
from .runner import Folders, default_jobs, diagnose, generate, plan_for, score
from .sealing import SealError

PRODUCT = "bha diagnose {arm} {train} --holdout {holdout} --out {out}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="blindgen", description="Blind test of the diagnosis workflow.")
    commands = parser.add_subparsers(dest="command", required=True)
    for name, text in (
        ("generate", "write the cases of the plan"),
        ("diagnose", "call the product on every case"),
        ("score", "compare with the sealed answers"),
        ("all", "generate, diagnose, score"),
    ):
        sub = commands.add_parser(name, help=text)
        sub.add_argument("--out", type=Path, default=Path("out/blind"), help="folder of the run")
        sub.add_argument("--seed", type=int, default=1, help="seed of the plan")
        sub.add_argument("--subset", choices=("tune", "report", "all"), default="tune")
        sub.add_argument("--cases", type=int, default=None, metavar="N", help="only the first N of the subset")
        sub.add_argument("--jobs", type=int, default=default_jobs())
        if name in ("diagnose", "all"):
            sub.add_argument("--product", default=PRODUCT, help=f"command template, default: {PRODUCT!r}")
            sub.add_argument("--timeout", type=float, default=900.0, help="seconds for one case")
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
        folders = Folders(options.out.resolve())
        specs = plan_for(folders, options.seed, options.subset, options.cases)
        if options.command in ("generate", "all"):
            generate(folders, specs, options.jobs)
        if options.command in ("diagnose", "all"):
            diagnose(folders, specs, options.product, options.jobs, options.timeout)
        if options.command in ("score", "all"):
            score(folders, specs)
    except (ValueError, DivergedError, SealError, OSError) as error:
        print(f"blindgen: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("blindgen: interrupted; what is finished stays, the same command goes on from there", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
