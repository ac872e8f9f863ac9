"""What one sees first: help, version, and being told what was mistyped."""

import os
import re
import subprocess
import sys
from pathlib import Path

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
        ("piazzi compare b612", ["file,b612", "plain,b612-range", "plain,b612-range-q0"]),
        ("piazzi compare x --with sm", ["plain,smoother"]),
        ("piazzi determine x --agai", ["plain,--against"]),
        ("piazzi determine ceres", ["file,ceres", "plain,ceres-1801"]),
        ("piazzi orbits pass", ["file,pass"]),
        ("piazzi tracking x --to y", ["file,y"]),
        ("piazzi study leo", ["file,leo", "plain,leo-radar"]),
        ("piazzi scenarios show gto", ["file,gto", "plain,gto-radar"]),
        ("piazzi scenarios check my", ["file,my"]),
        ("piazzi report x -o pa", ["file,pa"]),
        ("piazzi compare x --report ou", ["dir,ou"]),
        ("piazzi determine x --stations il", ["file,il", "plain,ilrs"]),
        ("piazzi compare x --scenario sun", ["file,sun", "plain,sun-sync-day"]),
        ("piazzi difference a b", ["file,b"]),
    ],
)
def test_shells_complete_what_is_typed(typed, offered):
    """As the scripts that click makes for bash ask for it."""
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1), "_PIAZZI_COMPLETE": "bash_complete"}
    program = [sys.executable, "-P", "-c", MAIN]
    done = subprocess.run(program, env=os.environ | words, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == offered


@pytest.mark.parametrize(
    ("typed", "offered"), [("determine la", "lageos-2"), ("compare b612-range-", "b612-range-q0"), ("determine pa", "")]
)
def test_the_script_for_bash_offers_words_and_leaves_files_to_the_shell(typed, offered):
    script = f"""compopt() {{ echo "files: $1 $2" >&2; }}
eval "$(_PIAZZI_COMPLETE=bash_source piazzi)"
COMP_WORDS=(piazzi {typed}) COMP_CWORD=2 COMPREPLY=()
_piazzi_completion piazzi
echo "${{COMPREPLY[*]}}" """
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(["bash", "-c", script], env=os.environ | {"PATH": path}, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == offered
    assert done.stderr.strip() == "files: -o default"


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


def test_fish_is_given_whole_lines_of_help():
    """One comma parts the kind of an answer from it; those behind are of the help."""
    from piazzi.cli.completing import _Fish

    assert _Fish.source_template.count('string split -m 1 ","') == 1
    assert _Fish.source_template.count("string split") == 1
