"""A propagation as text: what was moved, by which forces, and the last state with its standard deviations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult


class Propagated:
    """What `piazzi propagate` prints, of the object that its JSON is."""

    def __init__(self, found: Mapping[str, Any]) -> None:
        self.found = found

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.text import Text

        from piazzi.text import printable

        for line in self.lines():
            yield Text(printable(line))

    def lines(self) -> Iterator[str]:
        """The text, line by line."""
        found = self.found
        first, last = found["first"], found["last"]
        span = f"{_when(first)} to {_when(last)}"
        yield f"{found['object']}: {found['count']:,} states, {span}"
        yield f"From {found['source']}"
        yield f"Forces: {found['forces']}"
        yield from (f"Assumed: {text}." for text in found["assumed"])
        yield ""
        yield f"{'at ' + _when(last):34s} {'':14s}" + ("  sigma" if "sigma" in last else "")
        for i, (name, unit) in enumerate(zip(found["names"], found["units"], strict=True)):
            sigma = last["sigma"][i] if "sigma" in last else None
            text = f"{name + (f' [{unit}]' if unit else ''):20s} {last['mean'][i]:28.6f}"
            yield text + (f"  {sigma:.4g}" if sigma is not None else "")
        if "sigma_rtn" in last:
            r, t, n = (f"{s:.4g}" for s in last["sigma_rtn"][:3])
            yield f"sigma along R, T, N: {r}, {t}, {n} m"
        elif "sigma" not in last:
            yield "There is no covariance, and none is made."
        if not found["success"]:
            yield found["message"]


def _when(at: Mapping[str, Any]) -> str:
    return str(at["epoch"]) if "epoch" in at else f"{at['t']:g} s"
