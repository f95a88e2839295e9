"""The command `kfcourse`: which commands there are, and what becomes of errors and signals.

A command is imported when it is asked for, so that help comes at once.
"""

from __future__ import annotations

import errno
import signal
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from types import FrameType
from typing import NamedTuple

import click


class Command(NamedTuple):
    """Where a command is, and the first sentence of its help."""

    module: str
    says: str


# One line a command: this is where a new one is added.
COMMANDS = {
    "check": Command(
        "kfcourse.cli", "Check a derivation line by line: FILE has chains of lines such as F = M[(g*x - h)^2] and = g^2*d."
    ),
    "estimate": Command(
        "kfcourse.cli", "Estimate the states from your own measurements, FILE (CSV): forward, looking back, and judged."
    ),
    "exercises": Command("kfcourse.notebooks.commands", "Write the students' notebooks, ready to run."),
    "filters": Command("kfcourse.cli", "Say of each filter whether VARIANT, of FILE or of the lab, admits it, and why not."),
    "grade": Command("kfcourse.notebooks.commands", "Run the returned notebooks in FOLDER and write a table of what passed."),
    "lab": Command("kfcourse.cli", "Compare the filters on VARIANT (such as 53) and write the report."),
    "solutions": Command("kfcourse.notebooks.commands", "Write the worked solutions: executed notebooks and HTML pages."),
    "variants": Command("kfcourse.listing", "List the variants of the lab, check them, or propose new ones."),
}


class _Ended(BaseException):
    """A signal asks this process to end."""


@contextmanager
def _clear_errors() -> Iterator[None]:
    """What went wrong is said in a sentence, not in a traceback; an end by a signal leaves no half files."""
    try:
        with _ended_by({signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # NumPy's: what became infinite is reported by name
            warnings.showwarning = lambda message, *_: click.echo(f"Warning: {message}", err=True)
            yield
    except ValueError as error:
        raise click.ClickException(str(error)) from None
    except ArithmeticError as error:
        from kfcourse.montecarlo.designing import NotFinite

        if not isinstance(error, NotFinite):
            raise
        raise click.ClickException(str(error)) from None
    except MemoryError:
        raise click.ClickException("this needs more memory than there is; take fewer --runs, --steps or --jobs") from None
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        remedy = "; make room, and run it again" if error.errno == errno.ENOSPC else ""
        raise click.ClickException(f"{error.strerror or error}{where}{remedy}") from None
    except KeyboardInterrupt:
        click.echo("Interrupted; files written before are as they were.", err=True)
        sys.exit(130)
    except _Ended as ended:
        click.echo("Ended by a signal; files written before are as they were.", err=True)
        sys.exit(128 + ended.args[0])


@contextmanager
def _ended_by(numbers: Iterable[int]) -> Iterator[None]:
    """Signals that end a process as errors, so that what was begun is cleared away."""

    def end(number: int, _: FrameType | None) -> None:
        raise _Ended(number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, end) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Group(click.Group):
    """Commands that are imported when they are asked for, and say in a sentence what a user did wrong."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return getattr(import_module(COMMANDS[name].module), name) if name in COMMANDS else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        click.Group(commands={name: click.Command(name, help=one.says) for name, one in COMMANDS.items()}).format_commands(
            ctx, formatter
        )

    def invoke(self, ctx: click.Context) -> object:
        with _clear_errors():
            try:
                return super().invoke(ctx)
            except click.UsageError as error:
                if "unexpected extra argument" not in error.message:
                    raise
                hint = "separate names by commas (--sets a,b), and repeat --variant for each variant"
                raise click.UsageError(f"{error.message}: {hint}", error.ctx) from None


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="kfcourse")
def main() -> None:
    """Kalman and nonlinear suboptimal filtering: the lab from the command line."""
