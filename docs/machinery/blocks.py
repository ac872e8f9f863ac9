"""Pages whose code runs: fenced `python` blocks share one namespace, `console` blocks are typed into a shell.

A `text` block after a `python` block is what that prints; in a `console` block the lines under a command are what it
answers; "..." stands for any number of lines that are left out.  A block that begins with "# NAME.toml" or such is saved
under that name.  `run` checks both to the letter, except for blanks at
the ends of lines.  What the code saves, pictures and tables, goes into the folder that it runs in.

    python docs/machinery/blocks.py PAGE     puts what the code prints into the page; read the difference before keeping it
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

NAMED = re.compile(r"# ([\w-]+\.toml)\n")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])\d+(?:[.,]\d+)*(?:e[+-]?\d+)?")
WIDTH = 110


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its text, and the line of the page that it begins on."""

    language: str
    text: str
    line: int


def blocks(page: str) -> list[Block]:
    """All fenced blocks of a page, in order."""
    return [Block(m[1], m[2], page.count("\n", 0, m.start()) + 1) for m in FENCE.finditer(page)]


def prose(page: str) -> str:
    """The page without fenced blocks, spans of code, formulas and targets of links."""
    text = FENCE.sub("", page)
    for pattern in (r"\$\$.*?\$\$", r"\$[^$\n]*\$", r"`[^`]*`", r"\]\([^)]*\)", r"^\|.*\|$"):
        text = re.sub(pattern, " ", text, flags=re.DOTALL | re.MULTILINE)
    return text


def unfounded(page: str) -> list[str]:
    """Numbers of the prose with a decimal point, or of three digits and more, that no block of the page shows; not years."""
    shown = {m for block in blocks(page) for m in NUMBER.findall(block.text)}
    said = [m.group().rstrip(".,") for m in NUMBER.finditer(prose(page))]
    return [n for n in said if ("." in n or len(n) > 2) and n not in shown and not re.fullmatch(r"(?:19|20)\d\d", n)]


def run(path: Path, folder: Path) -> None:
    """Run every block of a page in `folder`.

    Raises
    ------
    AssertionError
        Where something else comes out than the page says, with the line of the page.
    """
    for block, said, got in outputs(path, folder):
        if not matches(said, got):
            raise AssertionError(f"{path.name}:{block.line} should say\n{said}\nbut gives\n{got}")


def outputs(path: Path, folder: Path) -> Iterator[tuple[Block, str, str]]:
    """For every block that runs: it, what the page says comes out, and what does."""
    names: dict[str, object] = {"__name__": "__page__"}
    found = blocks(path.read_text(encoding="utf-8"))
    for block, following in zip(found, [*found[1:], None], strict=True):
        if (named := NAMED.match(block.text)) is not None:
            (folder / named[1]).write_text(block.text, encoding="utf-8")
        if block.language == "python":
            said = following.text if following is not None and following.language == "text" else ""
            printed = io.StringIO()
            with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
                code = compile("\n" * block.line + block.text, str(path), "exec", dont_inherit=True)
                exec(code, names)
            yield block, said, printed.getvalue()
        elif block.language == "console":
            for command in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
                typed, said = re.match(r"((?:[^\n]*\\\n)*[^\n]*\n)(.*)", command, re.DOTALL).groups()
                yield block, said, shell(typed, folder)


def shell(command: str, folder: Path) -> str:
    """What a command typed into a shell answers on its standard output; it must succeed."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"],
        cwd=folder, env={**os.environ, "PATH": path, "COLUMNS": str(WIDTH)}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    if done.returncode != 0:
        raise AssertionError(f"{command.strip()} ended with status {done.returncode}:\n{done.stderr}")
    return done.stdout


def matches(said: str, got: str) -> bool:
    """Whether what is said is what came, "..." on a line of its own being any lines."""
    trim = [line.rstrip() for line in said.strip("\n").splitlines()]
    pattern = "".join(r"(?:.*\n)*?" if line == "..." else re.escape(line) + r"\n" for line in trim)
    came = "".join(line.rstrip() + "\n" for line in got.strip("\n").splitlines())
    return re.fullmatch(pattern, came) is not None


def rewrite(path: Path) -> None:
    """Put what the code prints in place of what the page says it does."""
    page = path.read_text(encoding="utf-8")
    with TemporaryDirectory() as folder:
        for _, said, got in outputs(path, Path(folder)):
            if said and not matches(said, got):
                page = page.replace(said, "".join(line.rstrip() + "\n" for line in got.strip("\n").splitlines()), 1)
    path.write_text(page, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    rewrite(Path(sys.argv[1]).resolve())
