"""The command line, called in this process (fast) or as a program (for streams, signals and imports)."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from piazzi.cli.main import main
from tests.waiting import HANGS


@dataclass(frozen=True)
class Result:
    """What a call left behind."""

    status: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """Standard output as the one strict JSON object that it must be."""

        def refuse(name: str) -> None:
            raise AssertionError(f"{name} is not JSON")

        assert self.out.count("\n") == 1, self.out
        return json.loads(self.out, parse_constant=refuse)

    @property
    def said(self) -> list[str]:
        """Lines on stderr, but for those about compiling."""
        return [line for line in self.err.splitlines() if not line.startswith("piazzi: compiling")]

    def refused(self) -> str:
        """The one line that says what was wrong, after the checks that go with bad input."""
        assert self.status == 2, (self.status, self.out, self.err)
        assert self.out == ""
        assert "Traceback" not in self.err
        (line,) = self.said
        assert line.startswith("piazzi: ")
        return line


Call = Callable[..., Result]


@pytest.fixture
def call(capsys) -> Call:
    """Call the command line in this process."""

    def call(*arguments: object) -> Result:
        capsys.readouterr()
        status = main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return Result(status, out, err)

    return call


@pytest.fixture
def program() -> Call:
    """Run ``python -m piazzi`` as a program of its own."""

    def program(*arguments: object, **options: Any) -> Result:
        command = [sys.executable, "-m", "piazzi", *map(str, arguments)]
        if "input" not in options:
            options.setdefault("stdin", subprocess.DEVNULL)
        done = subprocess.run(command, capture_output=True, check=False, timeout=HANGS, **options)
        return Result(done.returncode, done.stdout.decode(), done.stderr.decode())

    return program
