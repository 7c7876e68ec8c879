"""The command ``bha``: one subcommand a file, loaded only when it is used."""

from __future__ import annotations

import importlib
from typing import Any

import click

from bha._core import __version__
from bha.cli.terminal import errors_as_lines

#: Subcommand -> (module, attribute, line of help). A new command is a file and a line here.
COMMANDS: dict[str, tuple[str, str, str]] = {
    "robots": ("bha.cli.robots", "robots", "The arms that ship with the package."),
    "new": ("bha.cli.new", "new", "A commented parameter file of a new arm, by questions or options."),
    "info": ("bha.cli.info", "info", "What a parameter file says, and what follows from it."),
    "view": ("bha.cli.view", "view", "An arm in the browser: live, or beside what was measured."),
    "check": ("bha.cli.check", "check", "Whether logs and a parameter file belong together."),
    "convert": ("bha.cli.convert", "convert", "Logs of other formats (ROS bags, MATLAB, HDF5) as CSV or Parquet."),
    "simulate": ("bha.cli.simulate", "simulate", "Simulate an arm from a log's pressures."),
    "experiment": ("bha.cli.experiment", "experiment", "The paper's experiments on a virtual arm."),
    "control": ("bha.cli.control", "control", "Controllers lead a plant along a reference, compared."),
    "identify": ("bha.cli.identify", "identify_command", "Parameters from measured logs, with intervals."),
    "excite": ("bha.cli.excite", "excite_command", "Pressures that make parameters known, and how well."),
    "sweep": ("bha.cli.sweep", "sweep", "Monte Carlo or grid over parameters and inputs, resumable."),
    "diagnose": ("bha.cli.diagnose", "diagnose", "Name what the model lacks, from measured logs."),
}


class Commands(click.Group):
    """A group whose subcommands are imported when called, so that ``bha --help`` answers at once."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a subcommand; its import and its arguments are covered by what says errors in lines."""
        with errors_as_lines():
            return super().invoke(ctx)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the subcommands, in the order in which one uses them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import and return a subcommand."""
        if name not in COMMANDS:
            return None
        module, attribute, _ = COMMANDS[name]
        command = getattr(importlib.import_module(module), attribute)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, help_line) for name, (_, _, help_line) in COMMANDS.items()])


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="bha")
def main() -> None:
    """Simulate, identify, diagnose and control pneumatic bellows arms."""
