"""Nothing in the working directory is run: a folder that somebody sent may hold Python files of any name."""

import os
import subprocess
import sysconfig
from pathlib import Path

import pytest

from tests.waiting import HANGS

PROGRAM = Path(sysconfig.get_path("scripts")) / "piazzi"
NAMES = ("numpy", "json", "signal", "pickle", "multiprocessing", "sympy", "llvmlite", "sitecustomize", "usercustomize")


def plant(folder: Path) -> None:
    """Files that say that they were run, under names that workers import."""
    code = f"open({str(folder / 'RUN')!r}, 'a').write(__name__ + '\\n')\nraise ImportError('planted')\n"
    for name in NAMES:
        (folder / f"{name}.py").write_text(code)
    (folder / "piazzi").mkdir()
    (folder / "piazzi" / "__init__.py").write_text(code)


def studied(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "DASK_DISTRIBUTED__WORKER__MULTIPROCESSING_METHOD": "spawn"}
    command = [PROGRAM, "study", "b612-range", "--runs", "6", "--with", "ekf", "-o", "s.nc", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=HANGS, check=False)


@pytest.mark.parametrize("path", [None, ""])
def test_worker_processes_run_nothing_of_the_working_directory(tmp_path, monkeypatch, path):
    """Nor where PYTHONPATH is there and empty."""
    plant(tmp_path)
    if path is None:
        monkeypatch.delenv("PYTHONPATH", raising=False)
    else:
        monkeypatch.setenv("PYTHONPATH", path)
    done = studied(tmp_path, "--workers", "2")
    assert not (tmp_path / "RUN").exists(), (tmp_path / "RUN").read_text()
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_workers_of_a_local_dask_cluster_run_nothing_of_the_working_directory(tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed")
    plant(tmp_path)
    done = studied(tmp_path, "--scheduler", "local", "--workers", "2")
    assert not (tmp_path / "RUN").exists(), (tmp_path / "RUN").read_text()
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_environment_is_as_it_was_after_a_local_dask_cluster():
    """What children must have is not left in the process that started them."""
    pytest.importorskip("distributed", reason="Dask is not installed")
    from piazzi.study.cluster import Cluster
    from piazzi.study.pool import ENVIRONMENT
    from tests.study.studies import small

    before = {name: os.environ.get(name) for name in ENVIRONMENT}
    team = Cluster(small(), "local", 1)
    try:
        (flag,) = team._client.run(lambda: __import__("sys").flags.safe_path).values()
        assert flag
    finally:
        team.close()
    assert {name: os.environ.get(name) for name in ENVIRONMENT} == before
