"""Installs Piazzi with the lowest or the newest versions that it allows, and runs every command with them.

`python tests/smoke/versions.py lowest|newest|pinned`: the wheel is built, looked into and installed where nothing else is.
pip knows no lowest versions, so each ``name>=1.2,<2`` of pyproject.toml becomes the constraint ``name==1.2``; newest are those
that pip finds, upper bounds or not, so that what comes next is known before it is allowed.  With the pinned versions every
notebook of the gallery runs, on kernels that the tests have compiled.  Everything else is made anew in .cache.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = Path(__file__).with_name("commands.py")
NOTEBOOKS = Path(__file__).with_name("notebooks.py")
WRITER = ROOT / "docs" / "machinery" / "notebooks.py"
EXTRAS = ("cluster", "jpl", "msis")  # what a user may ask for beyond what is always there


def parts(requirement: str) -> tuple[str, str, str]:
    """Name, extras and lowest version: ``dask[distributed]>=2024.1,<2030`` is ``dask``, ``[distributed]`` and ``2024.1``.

    Raises
    ------
    ValueError
        Where no lower bound is given.
    """
    found = re.match(r"\s*([\w.-]+)\s*(\[[^]]*\])?[^;]*>=\s*([\w.]+)", requirement)
    if found is None:
        raise ValueError(f"{requirement!r} has no lower bound")
    return found[1], found[2] or "", found[3]


def lowest(requirement: str) -> str:
    """The constraint that takes the lowest version."""
    name, _, version = parts(requirement)
    return f"{name}=={version}"


def newest(requirement: str) -> str:
    """The requirement without what keeps it from newer versions."""
    return "{}{}>={}".format(*parts(requirement))


def requirements() -> list[str]:
    """What Piazzi needs, these extras included."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [*project["dependencies"], *(r for extra in EXTRAS for r in project["optional-dependencies"][extra])]


def left_out(wheel: Path) -> list[str]:
    """Files of the package that a wheel does not have."""
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
    files = (path.relative_to(ROOT / "src").as_posix() for path in (ROOT / "src" / "piazzi").rglob("*") if path.is_file())
    return sorted(name for name in files if name not in inside and "__pycache__" not in name)


def written(folder: Path) -> list[Path]:
    """The notebooks of the gallery, made from its pages."""
    folder.mkdir()
    pages = sorted((ROOT / "docs" / "gallery").glob("*.md"))
    for page in pages:
        subprocess.run([sys.executable, WRITER, page, folder / f"{page.stem}.ipynb"], check=True)
    return [folder / f"{page.stem}.ipynb" for page in pages]


def steps(which: str, place: Path, wheel: Path, python: Path) -> list[list[str | Path]]:
    """What is run one after the other: installations, then the trial."""
    pip = [python, "-m", "pip", "-q", "-q", "--no-input", "--disable-pip-version-check", "install", "--no-compile"]
    trial = [python, "-P", COMMANDS]
    if which == "pinned":
        run = [python, "-P", NOTEBOOKS, place / "ran", *written(place / "notebooks")]
        return [[*pip, "-c", ROOT / "constraints.txt", wheel], run]
    if which == "newest":
        return [[*pip, *map(newest, requirements())], [*pip, "--no-deps", wheel], trial]
    (place / "constraints.txt").write_text("\n".join(map(lowest, requirements())))
    return [[*pip, "-c", place / "constraints.txt", f"{wheel}[{','.join(EXTRAS)}]"], trial]


def main(which: str) -> int:
    place = ROOT / ".cache" / f"smoke-{which}"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    venv.create(place / "venv", with_pip=True)
    python = place / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    warm = os.environ.get("PIAZZI_CACHE", str(ROOT / ".cache" / "tests"))
    environment = {**os.environ, "PIAZZI_CACHE": warm if which == "pinned" else str(place / "kernels")}
    try:
        build = [python, "-m", "pip", "-q", "-q", "--no-input", "--disable-pip-version-check", "wheel", "--no-deps"]
        subprocess.run([*build, "--wheel-dir", place, ROOT], check=True)
        (wheel,) = place.glob("*.whl")
        if missing := left_out(wheel):
            print(f"FAILED  {wheel.name} lacks {', '.join(missing)}")
            return 1
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB, every file of src/piazzi is in it", flush=True)
        for step in steps(which, place, wheel, python):
            subprocess.run(step, env=environment, check=True)
    except subprocess.CalledProcessError as error:
        return error.returncode
    finally:
        shutil.rmtree(place / "venv")
    return 0


if __name__ == "__main__":
    if sys.argv[1:] not in (["lowest"], ["newest"], ["pinned"]):
        sys.exit("usage: versions.py lowest|newest|pinned")
    sys.exit(main(sys.argv[1]))
