"""The direction of flow: a stage imports from itself and from the stages before it, and all of them reach the wheel."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src"
MODULES = sorted(SOURCE.glob("piazzi/**/*.py"))

# Upstream first; stages on one line may import each other.  `__init__` is the public face, made of what is above it.
STAGES = """
faces
text units drawn arrays
opening locks
expressions
model
kernels
outside
earth
tables
formats
problem tracking orbit
scenarios
simulation
estimate
io
evaluate
study
present
determination
loading
__init__
cli
__main__
"""
IMPORTED_AS = {"ccsds-ndm-py": "ccsds_ndm", "pyerfa": "erfa"}  # where a package and its module have different names
RANK = {stage: rank for rank, line in enumerate(STAGES.split("\n")) for stage in line.split()}


def stage_of(module: Path) -> str:
    """Name of the folder or file directly below `piazzi` that `module` belongs to."""
    return module.relative_to(SOURCE / "piazzi").parts[0].removesuffix(".py")


def stages_imported(module: Path) -> Iterator[tuple[int, str]]:
    """Line and stage of every import from piazzi; `piazzi.Problem` is no stage of its own but belongs to the public face."""
    package = module.relative_to(SOURCE).parent.parts
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            parent: tuple[str, ...] = ()
        elif isinstance(node, ast.ImportFrom):
            parent = (*package[: len(package) - node.level + 1 if node.level else 0], *(node.module or "").split("."))
        else:
            continue
        for alias in node.names:
            root, stage, *_ = *filter(None, parent), *alias.name.split("."), ""
            if root == "piazzi":
                yield node.lineno, stage if stage in RANK else "__init__"


def test_every_stage_has_a_place_in_the_order():
    assert MODULES
    assert {stage_of(module) for module in MODULES} <= RANK.keys()


def test_imports_point_upstream():
    wrong = [
        f"{module.relative_to(ROOT)}:{line}: {stage_of(module)} imports from {stage}, which is downstream"
        for module in MODULES
        for line, stage in stages_imported(module)
        if RANK[stage] > RANK.get(stage_of(module), len(STAGES))
    ]
    assert not wrong, "\n".join(wrong)


def test_no_circle_of_modules():
    """Imports within functions and those for types alone count: who reads a module has to read what it needs, and no more."""
    needs = {name: set(modules_imported(name)) - {name} for name in map(name_of, MODULES)}
    while free := {name for name, needed in needs.items() if not needed & needs.keys()}:
        needs = {name: needed - free for name, needed in needs.items() if name not in free}
    reached = {name: reach(name, needs) for name in needs}
    circles = {
        frozenset(other for other in found if name in reached[other]) for name, found in reached.items() if name in found
    }
    assert not [sorted(circle) for circle in circles]


def name_of(module: Path) -> str:
    """Dotted name of a module or package."""
    return ".".join(module.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__")


NAMES = {name_of(module): module for module in MODULES}


def modules_imported(name: str) -> Iterator[str]:
    """Modules of piazzi that one imports, wherever it does."""
    for node in ast.walk(ast.parse(NAMES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            named = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{name}: relative imports are not looked at"
            named = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for found in named:
            parts = found.split(".")
            yield from [".".join(parts[:i]) for i in range(len(parts), 0, -1) if ".".join(parts[:i]) in NAMES][:1]


def reach(name: str, needs: dict[str, set[str]]) -> set[str]:
    """Every module that one leads to, itself where it does."""
    found, waiting = set[str](), [name]
    while waiting:
        new = needs[waiting.pop()] & needs.keys() - found
        found |= new
        waiting += new
    return found


def packages_imported(folder: Path) -> dict[str, str]:
    """Packages of others that files below a folder import by name, with one place for each."""
    own = {"piazzi", "tests", *(file.stem for part in ("docs", "examples") for file in (ROOT / part).rglob("*.py"))}
    found: dict[str, str] = {}
    for file in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in {str(n).partition(".")[0] for n in names} - sys.stdlib_module_names - own:
                found.setdefault(name, f"{file.relative_to(ROOT)}:{node.lineno}")
    return found


def declared(requirements: list[str]) -> set[str]:
    """What requirements bring by name, extras and all: ``dask[distributed]>=1`` is dask and distributed."""
    names = {name for text in requirements for name in re.findall(r"[\w.-]+", re.split(r"[<>=!~;]", text)[0])}
    return {IMPORTED_AS.get(name, name.replace("-", "_")) for name in names}


def test_every_package_imported_is_declared():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras, runtime = project["optional-dependencies"], declared(project["dependencies"])
    in_a_notebook = {"IPython"}  # which is there where it is imported
    in_source = declared(extras["cluster"] + extras["jpl"] + extras["msis"]) | in_a_notebook
    for folder, known in (("src", in_source), ("tests", declared(extras["dev"]))):
        unknown = {name: place for name, place in packages_imported(ROOT / folder).items() if name not in runtime | known}
        assert not unknown, unknown


def test_every_package_declared_is_imported():
    """What a user has to install is used: by an import, or by its name handed to one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert declared(project["dependencies"]) - packages_imported(SOURCE).keys() == set()


@pytest.mark.slow
def test_wheel_carries_every_file_of_the_package(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path], cwd=ROOT, check=True, capture_output=True
    )
    with zipfile.ZipFile(*tmp_path.glob("*.whl")) as wheel:
        packed = set(wheel.namelist())
    files = {
        f.relative_to(SOURCE).as_posix() for f in SOURCE.glob("piazzi/**/*") if f.is_file() and "__pycache__" not in f.parts
    }
    assert files <= packed
