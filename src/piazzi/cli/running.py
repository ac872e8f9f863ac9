"""Around every command: errors and warnings as one line each, a quiet end on Ctrl-C and on a closed pipe."""

from __future__ import annotations

import logging
import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import click

from piazzi.opening import RecordingWarning
from piazzi.text import printable

DONE, INTERNAL, BAD_INPUT, NOT_ESTIMATED = 0, 1, 2, 3
INTERRUPTED, PIPE_CLOSED = 130, 141  # 128 and the number of the signal, as shells report it
_LONGEST = 600


def run(command: click.Command, arguments: Sequence[str] | None) -> int:
    """Call a command; returns its exit status, with every error told in one line on stderr."""
    _prepare_streams()
    loggers = [logging.getLogger(name) for name in ("piazzi.kernels", "piazzi.formats")]
    held: list[str] = []
    handler = _Lines(held)
    for logger in loggers:
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = partial(_show_warning, held)
            status = _guarded(command, arguments)
            for line in dict.fromkeys(held) if status != BAD_INPUT else ():  # a refusal stands alone
                say(line)
            return status
    finally:
        for logger in loggers:
            logger.removeHandler(handler)


def _guarded(command: click.Command, arguments: Sequence[str] | None) -> int:
    try:
        try:
            status = command.main(arguments, prog_name="piazzi", standalone_mode=False)
            if sys.stdout is not None:
                sys.stdout.flush()
        except click.Abort as error:  # click's name for Ctrl-C, and for the end of a file
            raise error.__cause__ or KeyboardInterrupt from None
        except SystemExit as error:  # click leaves this way from a closed pipe, and from nothing else
            raise BrokenPipeError from error
        return status if isinstance(status, int) else DONE
    except KeyboardInterrupt:
        say("interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        _abandon_stdout()
        return PIPE_CLOSED
    except Exception as error:
        if os.environ.get("PIAZZI_DEBUG", "0") not in ("", "0"):
            traceback.print_exc()
        status, message = _status_and_message(error)
        say(message)
        if isinstance(error, OSError):
            _abandon_stdout()
        return status


def _status_and_message(error: Exception) -> tuple[int, str]:
    """Exit status and message of an error."""
    from click.exceptions import NoArgsIsHelpError

    match error:
        case NoArgsIsHelpError():
            click.echo(error.format_message(), err=True)
            return BAD_INPUT, "no command given"
        case click.UsageError():
            path = error.ctx.command_path if error.ctx else "piazzi"
            where = path.removeprefix("piazzi").strip()
            text = error.format_message()
            text = text if text.endswith("...") else text.removesuffix(".")
            text = text if text[:2].isupper() else text[:1].lower() + text[1:]
            return BAD_INPUT, f"{where + ': ' if where else ''}{text} (see {path} --help)"
        case click.ClickException():
            return BAD_INPUT, error.format_message()
        case OSError():
            names = [os.fsdecode(name) or "''" for name in (error.filename, error.filename2) if isinstance(name, (str, bytes))]
            return BAD_INPUT, ": ".join([*names[:1], error.strerror or str(error) or type(error).__name__])
        case ValueError():
            return BAD_INPUT, str(error)
        case MemoryError():
            return BAD_INPUT, f"not enough memory ({error})" if str(error) else "not enough memory"
        case _:
            return INTERNAL, f"internal error, {type(error).__name__}: {error} (PIAZZI_DEBUG=1 shows where)"


def say(message: str, *, prefix: str = "piazzi: ") -> None:
    """Write one line to stderr, whatever the message contains."""
    text = printable(" ".join(str(message).split()))
    if len(text) > _LONGEST:
        text = text[: _LONGEST - 4] + " ..."
    with suppress(OSError, ValueError, AttributeError):  # where nobody listens any more
        sys.stderr.write(f"{prefix}{text}\n")
        sys.stderr.flush()


def _prepare_streams() -> None:
    """Characters that a terminal cannot show are replaced rather than fatal."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def _abandon_stdout() -> None:
    """Send what is still buffered nowhere, so that the interpreter's last flush cannot fail too."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def _show_warning(held: list[str], message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Say a warning; what was put right in a recording is held until it is known that it was of use."""
    line = f"warning: {message}"
    if issubclass(category, RecordingWarning):
        held.append(line)
    else:
        say(line)


class _Lines(logging.Handler):
    """Log records as lines on stderr: one for all that compiles, others as `_show_warning` holds what is put right."""

    def __init__(self, held: list[str]) -> None:
        super().__init__()
        self._held, self._told = held, False

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if not record.name.startswith("piazzi.kernels"):
            self._held.append(text)
        elif not text.startswith("compiling"):
            say(text)
        elif not self._told:
            self._told = True
            say("compiling what this kind of problem needs, once: seconds to a few minutes, later runs load it ...")
