"""How ``compare``, ``observability`` and ``windows`` end: the file, the page, and one object or tables on stdout."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from piazzi.cli import output, reporting
from piazzi.cli.running import DONE, NOT_ESTIMATED

if TYPE_CHECKING:
    from piazzi.present.report import Tab
    from piazzi.problem import Problem, Tracking

ENDINGS = (".json", ".csv")


class Result(Protocol):
    """What is told of a source; rich can show it."""

    @property
    def problem(self) -> Problem: ...

    @property
    def tracking(self) -> Tracking: ...

    @property
    def source(self) -> str: ...

    @property
    def success(self) -> bool: ...

    def to_dict(self) -> dict[str, Any]: ...


@dataclass(frozen=True)
class Ending:
    """What -o, --json and --report ask for."""

    output_file: str | None
    as_json: bool
    report: str | None

    def check(self) -> None:
        """Refuse what could not be written, before anything is computed; raises click.UsageError, OSError."""
        output.check_output(self.output_file, ENDINGS)
        reporting.check(self.report)

    def give(self, result: Result, rows: Callable[[], Sequence[Mapping[str, Any]]], tab: Callable[[], Tab]) -> int:
        """Write and print a result; the exit status.

        Parameters
        ----------
        rows : makes the records of a .csv
        tab : makes the tab of a page
        """
        wrote = []
        if self.output_file is not None:
            self._write(self.output_file, result, rows)
            wrote.append(f"Wrote {self.output_file}")
        if self.report is not None:
            wrote.append(f"Wrote {reporting.write(self.report, [tab()])}")
        if self.output_file == output.STDOUT:
            pass  # it has the object already
        elif self.as_json:
            output.print_json(result.to_dict())
        else:
            from piazzi.present.tables import heading

            output.print_rich(heading(result.problem, result.tracking, result.source), "", result, *wrote)
        return DONE if result.success else NOT_ESTIMATED

    def _write(self, path: str, result: Result, rows: Callable[[], Sequence[Mapping[str, Any]]]) -> None:
        if path == output.STDOUT or path.lower().endswith(".json"):
            output.write_json(path, result.to_dict())
        else:
            output.write_csv(path, rows())
