"""What pyproject.toml and constraints.txt say of versions; CI installs the lowest and the newest (`versions.py`)."""

import json
import re
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from tests.smoke import notebooks
from tests.smoke.versions import lowest, newest, parts, requirements

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EVERYTHING = [*PROJECT["dependencies"], *(text for extra in PROJECT["optional-dependencies"].values() for text in extra)]
PINS = dict(re.findall(r"(?m)^([\w.-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(encoding="utf-8")))
PRIVATE = {"click", "llvmlite", "numba"}  # whose insides are used, or whose errors are told


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part.isdecimal())


@pytest.mark.parametrize(
    ("requirement", "low", "open_ended"),
    [
        ("click>=8.2,<9", "click==8.2", "click>=8.2"),
        ("dask[distributed]>=2024.1", "dask==2024.1", "dask[distributed]>=2024.1"),
        ("a-b.c < 3 , >= 1.0.2", "a-b.c==1.0.2", "a-b.c>=1.0.2"),
        ("x!=1.3,>=1.2", "x==1.2", "x>=1.2"),
    ],
)
def test_lowest_and_newest_of_a_requirement(requirement, low, open_ended):
    assert lowest(requirement) == low
    assert newest(requirement) == open_ended


@pytest.mark.parametrize("requirement", ["numpy", "numpy<3", "numpy==2.0"])
def test_a_requirement_without_a_lower_bound_is_refused(requirement):
    with pytest.raises(ValueError, match="no lower bound"):
        lowest(requirement)


def test_all_that_is_needed_has_a_lowest_version():
    assert len([lowest(requirement) for requirement in requirements()]) > 10


def test_packages_whose_insides_are_used_have_a_version_to_stop_at():
    bounded = {re.match(r"[\w-]+", text)[0] for text in PROJECT["dependencies"] if "<" in text}
    assert bounded == PRIVATE


def test_all_that_is_needed_is_imported_somewhere():
    sources = [file.read_text(encoding="utf-8") for file in (ROOT / "src").rglob("*.py")]
    found = {name for source in sources for name in re.findall(r"(?m)^\s*(?:from|import) (\w+)", source)}
    bring = packages_distributions()
    used = {distribution.lower() for name in found for distribution in bring.get(name, [])}
    assert {parts(requirement)[0].lower() for requirement in PROJECT["dependencies"]} - used == set()


def test_pins_are_no_nightlies_are_within_the_bounds_and_name_no_index():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not line.startswith("#")] == [f"{name}=={version}" for name, version in PINS.items()]
    assert not [name for name, version in PINS.items() if ".dev" in version]
    pins = {name.lower(): numbers(version) for name, version in PINS.items()}
    for requirement in EVERYTHING:
        name, _, low = lowest(requirement).partition("==")
        assert numbers(low) <= pins[name.lower()], requirement
        stop = re.search(r"<\s*([\w.]+)", requirement)
        assert stop is None or pins[name.lower()] < numbers(stop[1]), requirement


def test_a_notebook_runs_as_code_and_one_that_fails_is_told(tmp_path, capsys):
    def kept(name, *cells):
        told = [{"cell_type": kind, "source": text.splitlines(keepends=True)} for kind, text in cells]
        (tmp_path / name).write_text(json.dumps({"cells": told}))
        return tmp_path / name

    good = kept("good.ipynb", ("markdown", "Words"), ("code", "x = 1\nx"), ("code", "!exit 0"), ("code", "assert x == 1"))
    bad = kept("bad.ipynb", ("code", "!exit 3"))
    assert notebooks.main(tmp_path / "ran", [good, bad]) == 1
    said = sorted(capsys.readouterr().out.splitlines())
    assert any(line.startswith("ok ") and "good.ipynb" in line for line in said)
    assert any(line.startswith("FAILED ") and "bad.ipynb" in line for line in said)
