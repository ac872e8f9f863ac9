"""An input with the command that reads it, and what has to hold of every command, whatever it was given."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.child import End

_MAY_SAY = re.compile(r"piazzi: compiling .*|.*; (skipped|refused|rejected)$|[\d,]+ (points x|runs? x) .* epochs$")
_HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2028\u2029]")
_LONGEST = 650


@dataclass(frozen=True)
class Case:
    """Files, a call, and what the call may do.

    Attributes
    ----------
    changes : files that it may change where it does not refuse its input
    makes : files that it may make there
    keeps : whether a refusal, too, may leave those changed: what came before the bad place was good
    says : whether a refusal may be several lines
    call : to run in place of the command line
    holds : what is wrong with the outcome, beyond what holds of all
    """

    files: dict[str, bytes]
    arguments: list[str]
    stdin: bytes = b""
    changes: frozenset[str] = frozenset()
    makes: frozenset[str] = frozenset()
    keeps: bool = False
    says: bool = False
    call: Callable[[], int] | None = None
    holds: Callable[[End, Path], list[str]] = field(default=lambda end, folder: [])


def shape(case: Case, end: End) -> str:
    """What kind of outcome this is: the command, its exit status, and its last line without names and numbers."""
    lines = [line for line in end.err.splitlines() if not _MAY_SAY.fullmatch(line)]
    last = re.sub(r"'[^']*'|\"[^\"]*\"|[-+\d.]+(e[-+]?\d+)?|\(.*?\)|nan|inf", "#", lines[-1][-300:] if lines else "")
    return f"{case.arguments[0] if case.arguments else ''} {end.status} {last[-60:]}"


def faults(case: Case, end: End, folder: Path, before: dict[str, bytes]) -> list[str]:
    """All that is wrong with how a command ended; `folder` holds `work` and `tmp`."""
    found = _told(case, end)
    after = files_in(folder / "work")
    mended = end.status in (0, 3) or (end.status == 2 and case.keeps)
    for name, data in before.items():
        if after.get(name) != data and not (mended and name in case.changes):
            found.append(f"{name} was {'changed' if name in after else 'removed'}")
    for name in sorted(after.keys() - before.keys()):
        if not (mended and name in case.makes):
            found.append(f"{name!r} was left behind")
    found += [f"{path.name!r} was left in the temporary folder" for path in (folder / "tmp").iterdir()]
    if not found and end.status in (0, 2, 3):
        found = case.holds(end, folder / "work")
    return found


def _told(case: Case, end: End) -> list[str]:
    """What is wrong with the exit status and what was said."""
    found = []
    if end.status not in (0, 2, 3):
        found.append(f"exit status {end.status}")
    if "Traceback" in end.err or "Traceback" in end.out:
        found.append("a traceback")
    lines = end.err.split("\n")
    if lines.pop():
        found.append("the last line on stderr has no end")
    for line in lines:
        if not (line.startswith("piazzi: ") or _MAY_SAY.fullmatch(line)) or not line.isprintable() or len(line) > _LONGEST:
            found.append(f"on stderr: {line[:200]!r}")
            break
    if _HIDDEN.search(end.out.replace("\r\n", "\n")):
        found.append("a control character on stdout")
    if end.status == 2 and not case.says:
        errors = [line for line in lines if not _MAY_SAY.fullmatch(line)]
        if len(errors) != 1:
            found.append(f"refused in {len(errors)} lines")
        if end.out and not case.keeps:
            found.append("refused with output on stdout")
    return found


def files_in(folder: Path) -> dict[str, bytes]:
    """Names and contents of all files below a folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
