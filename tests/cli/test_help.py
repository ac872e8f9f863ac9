"""What one sees first: help, version, and being told what was mistyped."""

import os
import re
import subprocess
import sys

import pytest

import piazzi
from piazzi.cli.commands import COMMANDS, GROUPS
from piazzi.estimate.registry import ESTIMATORS

MAIN = "import sys; sys.argv = ['piazzi']; from piazzi.cli.main import main; main()"


def test_version(call):
    assert call("--version").out == f"piazzi {piazzi.__version__}\n"


def test_help_lists_the_commands_in_whole_sentences(call):
    result = call("--help")
    assert result.status == 0
    for name in COMMANDS:
        (line,) = re.findall(rf"^  {name} +(.*)$", result.out, re.M)
        assert line.endswith(".")
        assert not line.endswith("...")


@pytest.mark.parametrize("command", [(), *[(name,) for name in COMMANDS], ("scenarios", "check")])
def test_every_help_fits_a_terminal_and_has_examples(call, command):
    result = call(*command, "--help")
    assert result.status == 0
    assert "Examples" in result.out or len(command) > 1
    assert "----" not in result.out
    assert max(map(len, result.out.splitlines())) <= 80


def test_commands_stand_by_what_people_want(call):
    text = call("--help").out
    headings = [text.index(f"\n{heading}:\n") for heading in GROUPS]
    assert headings == sorted(headings)
    assert [name for names in GROUPS.values() for name in names] == re.findall(r"^  (\w+) +\S", text[headings[0] :], re.M)


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("piazzi det", ["plain,determine"]),
        ("piazzi compare b612", ["plain,b612-range", "plain,b612-range-q0", "file,b612"]),
        ("piazzi compare x --with sm", ["plain,smoother"]),
        ("piazzi determine x --agai", ["plain,--against"]),
    ],
)
def test_shells_complete_what_is_typed(typed, offered):
    """As the scripts that click makes for bash ask for it."""
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1), "_PIAZZI_COMPLETE": "bash_complete"}
    program = [sys.executable, "-P", "-c", MAIN]
    done = subprocess.run(program, env=os.environ | words, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == offered


def test_help_names_the_estimators_that_there_are(call):
    text = call("compare", "-h").out
    for entry in ESTIMATORS.values():
        assert entry.syntax in text


def test_no_command_shows_the_help(call):
    result = call()
    assert result.status == 2
    assert result.out == ""
    assert "Usage: piazzi" in result.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["estmate"], "unknown command 'estmate'; did you mean 'estimate'?"),
        (["xyz"], "unknown command 'xyz'; known: determine, tracking, propagate"),
        (["estimate"], "estimate: missing argument 'SOURCE'"),
        (["estimate", "a", "b"], "estimate: got unexpected extra argument (b)"),
        (["estimate", "a", "--wiht", "ekf"], "did you mean '--with'?"),
        (["estimate", "a", "--with"], "option '--with' requires an argument"),
        (["estimate", "a", "--seed", "x"], "'--seed'"),
        (["estimate", "a", "--seed", "-1"], "'--seed': -1 is not in the range"),
        (["compare", "b612-range", "--with", "ekff"], "compare: --with: unknown estimator 'ekff'; did you mean 'ekf'?"),
        (["compare", "b612-range", "--with", "window:x"], "write window:LAG"),
        (["estimate", ""], "estimate: SOURCE is empty"),
        (["estimate", "b612-rang"], "'b612-rang'; did you mean 'b612-range'"),
        (["estimate", "rows.csv"], "estimate: rows.csv: --scenario NAME says what it measures"),
        (["demo", "--format", "gif"], "demo: invalid value for '--format'"),
    ],
)
def test_what_was_mistyped_is_named_in_one_line(call, arguments, message):
    assert message.lower() in call(*arguments).refused().lower()
