"""Runs notebooks of the gallery, cell by cell as Jupyter would: `python tests/smoke/notebooks.py FOLDER NAME.ipynb ...`.

Needs nothing but Piazzi and what it requires.  Each runs in FOLDER/NAME, which is made; ends with the number that fail.
"""

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PATIENCE = 900.0  # seconds, for a machine that is busy
CELL = "assert __import__('os').system({!r}) == 0\n"


def code(notebook: Path) -> str:
    """What a notebook runs, commands for the shell included."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    lines = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code").splitlines(keepends=True)
    return "".join(CELL.format(line[1:].strip()) if line.startswith("!") else line for line in lines)


def run(notebook: Path, folder: Path) -> bool:
    """Whether a notebook runs to its end; says so."""
    (folder / notebook.stem).mkdir(parents=True)
    started = time.monotonic()
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])  # where `piazzi` is
    program = [sys.executable, "-P", "-c", code(notebook)]
    told = {"capture_output": True, "text": True, "timeout": PATIENCE}
    done = subprocess.run(program, cwd=folder / notebook.stem, env={**os.environ, "PATH": path}, check=False, **told)
    said = "" if done.returncode == 0 else done.stderr[-2000:]
    print(f"{'FAILED' if said else 'ok':6} {time.monotonic() - started:5.1f} s  {notebook.name}  {said}", flush=True)
    return not said


def main(folder: Path, notebooks: list[Path]) -> int:
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda notebook: run(notebook, folder), notebooks)).count(False)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]]))
