"""What commands write: text on stdout, progress on stderr, files all at once or not at all."""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from rich.console import Console

STDOUT = "-"
_UNLIMITED = 1000  # columns where nobody looks at a terminal: nothing wraps


def print_json(value: Any) -> None:
    """One strict JSON object on stdout."""
    _stdout().write(json.dumps(value, allow_nan=False) + "\n")


def print_text(text: str) -> None:
    """Text on stdout as it is."""
    _stdout().write(text if text.endswith("\n") else text + "\n")


def print_rich(*parts: Any) -> None:
    """Tables and text on stdout: coloured on a terminal, plain and unwrapped in a pipe.  A plain string is never wrapped."""
    from rich.console import Console

    from piazzi.text import printable

    class Plain(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    stream = _stdout()
    given = os.environ.get("COLUMNS", "")
    columns = int(given) if given.isdecimal() and given.isascii() else 0  # some shells and editors set 0 where they do not know
    width = columns or (shutil.get_terminal_size().columns if stream.isatty() else _UNLIMITED)
    height = shutil.get_terminal_size().lines  # given both, rich does not read COLUMNS itself, which may be no number
    console = Plain(file=stream, width=width, height=height, highlight=False, emoji=False, markup=False)
    for part in parts:
        console.print(printable(part) if isinstance(part, str) else part, soft_wrap=isinstance(part, str))


def _stdout() -> Any:
    if sys.stdout is None:
        raise ValueError("standard output is closed")
    return sys.stdout


def check_output(path: str | None, endings: Sequence[str], option: str = "-o") -> None:
    """Refuse a file that could not be written, before anything is computed; "-" and None are always fine.

    Raises
    ------
    click.UsageError
        For an ending that is not one of `endings`.
    OSError
        Where nothing can be written there.
    """
    if path is None or path == STDOUT:
        return
    if Path(path).suffix.lower() not in endings:
        raise click.UsageError(
            f"{option} {path or repr(path)}: the file must end in {', '.join(endings)}", click.get_current_context(silent=True)
        )
    check_place(path)


def check_place(path: str) -> None:
    """Raise OSError where no file can be written at `path`.  Nothing is changed."""
    from piazzi.io.atomic import check_writable

    check_writable(path)
    target = os.path.realpath(path)
    if not os.path.exists(target) or os.path.isfile(target):
        try:
            with tempfile.TemporaryFile(dir=os.path.dirname(target)):
                pass  # some folders refuse files whatever their permissions say; one without a name leaves nothing
        except OSError as error:
            raise type(error)(error.errno, f"cannot be written: {error.strerror}", path) from None


def make_folder(path: str | os.PathLike[str], file: str) -> None:
    """Make a folder in one that is there; raises OSError where there can be none, or this file cannot be written in it."""
    folder = Path(path)
    if not os.fspath(path):
        raise click.UsageError(f"{os.fspath(path)!r} is no folder: name one", click.get_current_context(silent=True))
    try:
        folder.mkdir(exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise NotADirectoryError(error.errno, "no folder can be made there: a file is in the way", os.fspath(path)) from None
    except OSError as error:
        why = error.strerror if folder.parent.exists() else f"there is no folder {folder.parent}"
        raise type(error)(error.errno, f"no folder can be made there: {why}", os.fspath(path)) from None
    check_place(os.fspath(folder / file))


def write_json(path: str, value: Any) -> None:
    """Strict JSON into a file, all at once, or on stdout for "-"."""
    if path == STDOUT:
        print_json(value)
        return
    from piazzi.io.atomic import atomic_path

    with atomic_path(path) as work:
        work.write_text(json.dumps(value, allow_nan=False, indent=1) + "\n", encoding="utf-8")


def write_csv(path: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Rows by their keys as CSV, None and what a row does not have as empty cells, all at once."""
    import csv

    from piazzi.io.atomic import atomic_path

    with atomic_path(path) as work, open(work, "w", newline="", encoding="utf-8") as file:
        keys = list(dict.fromkeys(key for row in rows for key in row))
        writer = csv.writer(file)
        writer.writerow(map(_cell, keys))
        writer.writerows([_cell(row.get(key)) for key in keys] for row in rows)


def _cell(value: Any) -> Any:
    """Text that nothing is hidden in, and that no spreadsheet takes for a formula; anything else as it is."""
    if not isinstance(value, str):
        return value
    from piazzi.text import escape_formula, printable

    return escape_formula(printable(value))


def beside() -> Console:
    """Where bars are drawn: stderr, as wide as the terminal."""
    from rich.console import Console

    size = shutil.get_terminal_size()
    return Console(stderr=True, width=size.columns, height=size.lines)


@contextmanager
def progress(total: int, long: bool = True) -> Iterator[Callable[[str], None]]:
    """A function to call with the name of each step as it begins; shows a bar where work is long and stderr is a terminal."""
    if not (long and sys.stderr is not None and sys.stderr.isatty()):
        yield lambda step: None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(bar_width=24), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=beside(), transient=True) as bar:
        task = bar.add_task("", total=total)
        done = -1

        def step(name: str) -> None:
            nonlocal done
            done += 1
            bar.update(task, completed=done, description=name)

        yield step
