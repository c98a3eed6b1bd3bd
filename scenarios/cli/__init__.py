"""The `minisim` command. It may import every other package.

Each module of this package adds the command of its name to the app. A command imports what it needs
when it runs, so that `minisim --help` is quick.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import shlex
import signal
import sys
import traceback
from collections.abc import Sequence

import typer

from minisim.errors import CollisionError, InputError, MinisimError
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import drop_output, prepare_streams
from scenarios.termination import Terminated, terminable

__all__ = ["COMMANDS", "app", "main"]

#: The help lists these first, then the others by name.
_FIRST = (
    "demo", "run", "controllers", "animate", "lab", "sweep", "figures", "reproduce", "benchmark",
    "crossval", "train",
)  # fmt: skip

#: The names of the commands, in the order of the help.
COMMANDS = tuple(sorted(
    (module.name for module in pkgutil.iter_modules(__path__) if not module.ispkg),
    key=lambda name: (_FIRST.index(name) if name in _FIRST else len(_FIRST), name),
))  # fmt: skip

for _command in COMMANDS:
    importlib.import_module(f"scenarios.cli.{_command}")

#: What typer raises for a wrong command line: the parent of its public `BadParameter`.
_USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    Bad input gives one line on stderr and code 2; a collision that stops a run, or a stdout that
    cannot be written, 1; Ctrl-C 130; SIGTERM 143. MINISIM_TRACEBACK=1 adds a failure's traceback.
    """
    prepare_streams()
    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        _check_once(given)
        with terminable():
            code = app(given or ["--help"], prog_name="minisim", standalone_mode=False, obj=given)
        sys.stdout.flush()
    except MinisimError as error:
        if os.environ.get("MINISIM_TRACEBACK"):
            traceback.print_exception(error)
        told = "; ".join([str(error), *getattr(error, "__notes__", ())])
        return _fail(told, 1 if isinstance(error, CollisionError) else 2)
    except _USAGE_ERROR as error:
        message = str(getattr(error, "format_message", error.__str__)()).rstrip(".")
        command = [name for name in given[:1] if name in COMMANDS]
        see = shlex.join(["minisim", *command, "--help"])
        return _fail(f"{message} (typed: {shlex.join(given)}; see {see})")
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Terminated as end:
        return _fail("terminated", end.code)
    except BrokenPipeError:  # the reader of our output has stopped early, as `head` does
        drop_output()
        return 1
    except OSError as error:
        if error.filename is not None:
            return _fail(f"cannot use {error.filename}: {error.strerror}")
        drop_output()
        return _fail(f"cannot write to stdout: {error.strerror or error}", 1)
    if code == 130:
        return _fail("interrupted", code)
    return code if isinstance(code, int) else 0


def _check_once(given: Sequence[str]) -> None:
    """Raise `InputError` for an option that is given twice and would count only once."""
    words = [word.partition("=")[0] if word[:2] == "--" else word[:2] for word in given]
    command = typer.main.get_command(app)
    for option in getattr(command, "commands", {}).get(given[0] if given else "", command).params:
        used = [word for word in words if word in option.opts]
        if len(used) > 1 and option.param_type_name == "option" and not option.multiple:
            raise InputError(f"{used[-1]} is given twice; minisim {given[0]} takes one")


def _fail(message: str, code: int = 2) -> int:
    typer.echo(f"minisim: {' '.join(message.split())}", err=True)
    return code
