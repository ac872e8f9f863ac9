"""What shells complete: words that are known and files of the user's, by what the help calls an argument or an option."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import click
from click.shell_completion import CompletionItem, FishComplete, add_completion_class

FILE, FOLDER = "file", "dir"


def _cases() -> Iterable[str]:
    from piazzi.determination.case_file import names

    return names()


def _scenarios() -> Iterable[str]:
    from piazzi.scenarios import names

    return names()


def _estimators() -> Iterable[str]:
    from piazzi.estimate.registry import ESTIMATORS

    return ESTIMATORS


def _stations() -> Iterable[str]:
    return ("ilrs", "mpc")


def _none() -> Iterable[str]:
    return ()


# by metavar, or by the name of a parameter: the words that are known, and what of the user's own may stand there
OFFERED: dict[str, tuple[Callable[[], Iterable[str]], str]] = {
    **dict.fromkeys(("FILE", "FILE|TEXT", "A", "B", "CASE", "FORCES", "ORBIT"), (_none, FILE)),
    **dict.fromkeys(("DIR", "FOLDER"), (_none, FOLDER)),
    **dict.fromkeys(("SOURCE", "SOURCE...", "SCENARIO", "scenario", "name"), (_scenarios, FILE)),
    "ESTIMATOR": (_estimators, ""),
    **dict.fromkeys(("TRACKING...", "FILE..."), (_cases, FILE)),
    "stations": (_stations, FILE),
}


class _Fish(FishComplete):
    """Whole lines of help: the script of click ends them at the first comma."""

    source_template = FishComplete.source_template.replace('string split ","', 'string split -m 1 ","')


add_completion_class(_Fish, "fish")


class Completed(click.types.StringParamType):
    """Text of which shells know how it may go on."""

    def __init__(self, words: Callable[[], Iterable[str]], others: str) -> None:
        self.words = words
        self.others = others

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        found = [CompletionItem(word) for word in self.words() if word.startswith(incomplete)]
        # first, for in bash what stands before it is dropped, and it is asked for where no word is left
        return [CompletionItem(incomplete, type=self.others), *found] if self.others else found


def completed(params: Iterable[click.Parameter]) -> None:
    """Let shells complete these parameters of a command, where they are text."""
    for param in params:
        offered = OFFERED.get(param.name or "") or OFFERED.get(param.metavar or "")
        if offered is not None and param.type is click.STRING:
            param.type = Completed(*offered)
