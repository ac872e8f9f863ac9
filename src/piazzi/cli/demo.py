"""``piazzi demo``: both founding problems and an orbit about the Earth, simulated, estimated and drawn."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from piazzi.cli import options, output, results
from piazzi.cli.compare import DEFAULT
from piazzi.cli.running import DONE, NOT_ESTIMATED

if TYPE_CHECKING:
    from piazzi.evaluate import Comparison
    from piazzi.scenarios import Scenario

PROBLEMS = ("satellite-bearing", "b612-range", "gps-position")
PICTURES = 5
KINDS = ("png", "pdf", "svg")


@click.command(cls=options.Command)
@click.option("-o", "--output", "folder", metavar="DIR", default="demo", show_default=True, help="Folder to write into.")
@click.option("--format", "kind", type=click.Choice(KINDS), default=KINDS[0], show_default=True, help="Format of the pictures.")
@results.title_option
@options.seed
def command(folder: str, kind: str, seed: int) -> int:
    """Simulate and estimate three problems, with pictures.

    satellite-bearing is a satellite seen only by its bearing; b612-range a probe around a tiny planet seen only by its range;
    gps-position a satellite about the real Earth that measures its own position.

    Examples:
      piazzi demo
      piazzi demo -o figures --format pdf --seed 3
    """
    target = Path(folder)
    output.make_folder(folder, "report.html")
    for name in PROBLEMS:
        output.make_folder(target / name, "comparison.json")
    from piazzi.present.report import comparison_tab
    from piazzi.scenarios import load_scenario

    wrote: list[Path] = []
    tabs, success = [], True
    for name in PROBLEMS:
        scenario = load_scenario(name)
        with output.progress(len(DEFAULT) + PICTURES) as step:
            comparison = _compared(scenario, seed, step)
            wrote += _write_pictures(comparison, scenario, target / name, kind, step)
        wrote += _write_data(comparison, target / name)
        tabs.append(comparison_tab(comparison, title=scenario.title, planet_radius=scenario.picture.planet_radius))
        success &= comparison.success
        _print(comparison, scenario)
    _print_next_steps([*wrote, results.write_page(str(target), tabs)], target)
    return DONE if success else NOT_ESTIMATED


def _compared(scenario: Scenario, seed: int, step: Callable[[str], None]) -> Comparison:
    import numpy as np

    from piazzi.estimate.registry import parse
    from piazzi.evaluate import compare
    from piazzi.simulation import simulate

    tracking = simulate(scenario.problem, scenario.times, np.random.default_rng(seed))
    estimators = {name: parse(name) for name in DEFAULT}

    def announce(name: str) -> None:
        step(f"{scenario.name}: {name}")

    return compare(scenario.problem, tracking, estimators, source=scenario.name, announce=announce)


def _write_pictures(
    comparison: Comparison, scenario: Scenario, folder: Path, kind: str, step: Callable[[str], None]
) -> list[Path]:
    from piazzi.present.figures.pages import pages, save

    out = []
    for name, figure in pages(comparison, title=scenario.title, planet_radius=scenario.picture.planet_radius):
        step(f"{scenario.name}: picture of {name}")
        out.append(save(figure, folder / f"{name}.{kind}"))
    return out


def _write_data(comparison: Comparison, folder: Path) -> list[Path]:
    """Write the rows and the measurements; returns the paths."""
    from piazzi.io import save

    out = [folder / "comparison.json", folder / "tracking.csv"]
    output.write_json(str(out[0]), comparison.to_dict())
    save(out[1], comparison.problem, comparison.tracking)
    return out


def _print(comparison: Comparison, scenario: Scenario) -> None:
    from rich.text import Text

    from piazzi.present.tables import heading

    head = Text(scenario.title, style="bold")
    output.print_rich(head, heading(comparison.problem, comparison.tracking, scenario.name), "", comparison, "")


def _print_next_steps(wrote: list[Path], folder: Path) -> None:
    """Say what was written, and what to type next."""
    lines = [f"Wrote {len(wrote)} files in {folder}:", f"  {folder}: {wrote[-1].name}"]
    for name in PROBLEMS:
        lines.append(f"  {folder / name}: " + ", ".join(path.name for path in wrote if path.parent == folder / name))
    kept = folder / PROBLEMS[1] / "tracking.csv"
    lines += [
        "",
        f"Open {folder / 'report.html'} in a browser: all three problems on one page, to point at and to play.",
        "",
        "Next:",
    ]
    program = _program()
    for typed, why in (
        ("compare b612-range-q0", "the same probe, by filters that trust its dynamics entirely"),
        (f"estimate {kept} --scenario {PROBLEMS[1]}", "the last state in numbers"),
        ("scenarios show b612-range > mine.toml", f"a problem of your own: edit it, then {program} compare mine.toml"),
        ("--help", "everything else"),
    ):
        lines += [f"  {program} {typed}", f"      {why}"]
    output.print_text("\n".join(lines))


def _program() -> str:
    """What to type for piazzi here: its path, where a shell does not find it by its name."""
    called = Path(sys.argv[0])
    if called.name != "piazzi" or shutil.which("piazzi") is not None or not called.is_file():
        return "piazzi"
    inside = called.absolute().is_relative_to(Path.cwd())
    return str(called.absolute().relative_to(Path.cwd()) if inside else called)
