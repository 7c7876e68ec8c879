"""What commands show people: tables that cut no name, progress, warnings and errors as lines.

Text of others (names in files, paths) is never taken for markup, and what a stream cannot encode ends no command.
"""

from __future__ import annotations

import os
import sys
import threading
import time
import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

import click
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from bha.errors import BhaError, way_out

#: Exit code of Ctrl-C, as shells give it.
INTERRUPTED = 130

#: Where nobody looks, lines may be as long as they like.
_WIDE = 10_000
#: The least width of a column of running text, in characters.
_LEAST_TEXT = 24
# Seconds until progress is first told in lines, and between two of them.
_FIRST_LINE, _BETWEEN_LINES = 5.0, 10.0


def console() -> Console:
    """Where tables go: as wide as the terminal, or as wide as they need where there is none."""
    found = Console(highlight=False)
    return found if found.is_terminal else Console(highlight=False, width=_WIDE)


def visible(text: str) -> str:
    """The text with control characters as they are written in code: in a name they could move and colour the rest."""
    return "".join(
        character.encode("unicode_escape").decode() if _is_control(character) else character for character in text
    )


def _is_control(character: str) -> bool:
    return character not in "\n\t" and unicodedata.category(character) in ("Cc", "Cf")


def say(text: str, *, head: str = "") -> None:
    """Print a line of text as it is, ``head`` in bold before it: nothing is markup, nothing is cut or wrapped."""
    click.echo(click.style(visible(head), bold=True) + visible(text) if head else visible(text))


def say_error(text: str) -> None:
    """The same on standard error."""
    click.echo(visible(text), err=True)


class WholeTable(Table):
    """A table whose names and numbers are never cut or broken; where it is too wide, a paragraph a row.

    Cells are text as it is. The columns named ``running`` hold running text and may be wrapped.
    """

    def __init__(self, *headings: str, title: str | None = None, running: Sequence[str] = ()) -> None:
        """A table with these headings; units in brackets stay."""
        super().__init__(title=None if title is None else Text(visible(title)))
        self._rows: list[tuple[str, ...]] = []
        self._headings = headings
        self._running = [heading in running for heading in headings]
        for heading, wraps in zip(headings, self._running, strict=True):
            self.add_column(Text(heading), no_wrap=not wraps)

    def add_row(self, *cells: Any, **how: Any) -> None:
        """Add a row of texts."""
        texts = tuple(visible(str(cell)) for cell in cells)
        self._rows.append(texts)
        super().add_row(*(Text(text) for text in texts), **how)

    def _least_width(self) -> int:
        widths = []
        for place, heading in enumerate(self._headings):
            width = max(cell_len(text) for text in (heading, *(row[place] for row in self._rows)))
            widths.append(min(width, _LEAST_TEXT) if self._running[place] else width)
        return sum(widths) + 3 * len(widths) + 1  # the lines between them and a space on either side

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The table, or its rows one below the other."""
        if self._least_width() <= options.max_width:
            yield from super().__rich_console__(console, options)
            return
        if isinstance(self.title, Text):
            yield self.title
        for row in self._rows:
            yield Text(row[0], style="bold", overflow="fold")
            line = ""
            for heading, text in zip(self._headings[1:], row[1:], strict=False):
                pair = f"{heading} {text}".strip() if text else ""
                if pair and line and cell_len(f"  {line}  {pair}") > options.max_width:
                    yield Text(f"  {line}", overflow="fold")
                    line = ""
                line = f"{line}   {pair}" if line and pair else line or pair
            if line:
                yield Text(f"  {line}", overflow="fold")


def table(*headings: str, title: str | None = None, running: Sequence[str] = ()) -> WholeTable:
    """A table with these headings; ``running`` are those of the columns that may be wrapped."""
    return WholeTable(*headings, title=title, running=running)


class RateColumn(ProgressColumn):
    """How many of something are done a second."""

    def __init__(self, what: str) -> None:
        """``what`` is counted: ``"runs"``."""
        super().__init__()
        self._what = what

    def render(self, task: Task) -> Text:
        """``230 runs/s``."""
        return Text("" if task.speed is None else f"{task.speed:.3g} {self._what}/s")


class LineProgress(Progress):
    """Progress as lines of text at a calm rate, for logs of jobs: nothing within the first seconds."""

    def __init__(self, *, rate_of: str | None = None, first: float = _FIRST_LINE, between: float = _BETWEEN_LINES):
        """Tell after ``first`` seconds and every ``between`` seconds; ``rate_of`` are counted a second."""
        super().__init__(disable=True)
        self._rate_of, self._first, self._between = rate_of, first, between
        self._done = threading.Event()
        self._teller: threading.Thread | None = None

    def start(self) -> None:
        """Begin to tell."""
        self._done.clear()
        self._teller = threading.Thread(target=self._tell, name="progress", daemon=True)
        self._teller.start()

    def stop(self) -> None:
        """Tell no more."""
        self._done.set()
        if self._teller is not None:
            self._teller.join()
            self._teller = None

    def _tell(self) -> None:
        begin, told = time.monotonic(), ""
        wait = self._first
        while not self._done.wait(wait):
            wait = self._between
            for task in self.tasks[-1:]:
                text = f"{task.description}{self._share(task)}"
                if text != told:
                    minutes, seconds = divmod(int(time.monotonic() - begin), 60)
                    with suppress(OSError, ValueError):  # nobody listens any more
                        say_error(f"[{minutes}:{seconds:02d}] {text}")
                told = text

    def _share(self, task: Task) -> str:
        if not task.total:
            return ""
        text = f": {task.percentage:.0f} %"
        if self._rate_of is not None:
            text = f": {task.completed:.0f} of {task.total:.0f} {self._rate_of} ({task.percentage:.0f} %)"
            if task.speed:
                text += f", {task.speed:.3g} {self._rate_of}/s"
        return text


def progress_bar(*, hidden: bool = False, rate_of: str | None = None, time_left: bool = True) -> Progress:
    """Progress on standard error: a bar with the time left, or lines where no terminal is; silent if ``hidden``.

    With ``rate_of`` it says how many of these are done a second. Without ``time_left`` the description says it, who
    knows more than the speed of the bar.
    """
    errors = Console(stderr=True)
    if not hidden and not errors.is_terminal:
        return LineProgress(rate_of=rate_of)
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        *(() if rate_of is None else (RateColumn(rate_of),)),
        TimeElapsedColumn(),
        *((TimeRemainingColumn(),) if time_left else ()),
        console=errors,
        transient=True,
        disable=hidden,
    )


def fail(error: BhaError | str, code: int = 1) -> NoReturn:
    """Print an error and end the program."""
    say_error(f"error: {error}")
    sys.exit(code)


@contextmanager
def errors_as_lines() -> Iterator[None]:
    """Print errors without traceback, exit code 1, 130 after Ctrl-C; and warnings as lines, each once.

    The package's own errors say what to do. Those of the system and of other libraries should have become such where
    they arose; what was missed is told in a line too. Only a fault of the package itself shows a traceback.
    """
    _prepare_streams()
    told: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        text = f"warning: {message}"
        if text not in told:
            say_error(text)
        told.add(text)

    try:
        with warnings.catch_warnings():
            for category in (UserWarning, RuntimeWarning):  # the package's are UserWarnings
                warnings.simplefilter("always", category)
            warnings.showwarning = show
            yield
            if sys.stdout is not None:  # closed by whoever started the program
                sys.stdout.flush()
    except BhaError as error:
        fail(error)
    except KeyboardInterrupt:
        say_error("interrupted")
        sys.exit(INTERRUPTED)
    except BrokenPipeError:  # whoever read the output wants no more of it
        _discard_output()
        sys.exit(1)
    except OSError as error:
        _discard_output()
        fail(f"{error.filename if error.filename is not None else 'output'}: {way_out(error)}")
    except MemoryError:
        fail("there is not enough memory for that; use fewer rows, runs or threads")
    except Exception as error:
        library = type(error).__module__.partition(".")[0]
        if library in ("builtins", "click", "bha", "__main__") or "BHA_TRACEBACK" in os.environ:
            raise
        fail(f"{library}: {' '.join(str(error).split()) or type(error).__name__} (BHA_TRACEBACK=1 shows where)")


def _prepare_streams() -> None:
    """What a stream cannot encode becomes a question mark instead of an error."""
    for stream, errors in ((sys.stdout, "replace"), (sys.stderr, "backslashreplace")):
        if hasattr(stream, "reconfigure") and stream.errors != errors:
            stream.reconfigure(errors=errors)


def _discard_output() -> None:
    """Let the interpreter not stumble over what is still to be written when it ends."""
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)
    except (OSError, ValueError, AttributeError):
        pass  # no real stream
