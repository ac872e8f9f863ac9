"""Kernels survive on disk, damage is noticed, and nothing that others could have written is ever run."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

import piazzi
import piazzi as pz
from piazzi.kernels import KernelSpec, cache, folder, spec
from piazzi.kernels.bundle import Given
from tests.waiting import HANGS

PACKAGE = Path(piazzi.__file__).parent
MODEL = pz.Model(["x"], ["-k*x"], parameters=["k"])
GIVEN = Given(parameters=np.full(1, 0.5), manoeuvres=np.zeros(1), data=np.zeros(1))
SMALL = KernelSpec(MODEL, pz.Taylor(1).scheme, ("transition", "rates"))


def forget():
    """What a new process would not know."""
    folder.private_folder.cache_clear()
    folder.writable_folder.cache_clear()


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    """A cache folder of its own, nothing loaded, and a count of the compilations."""
    monkeypatch.setenv("PIAZZI_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_loaded", {})
    forget()
    yield tmp_path / "cache"
    forget()


@pytest.fixture(scope="module")
def compiled():
    """What compiling the small kernel gives, compiled once."""
    from piazzi.kernels.build import compile_entries
    from piazzi.kernels.entries import signatures

    kept = {}

    def once(source):
        if not kept:
            kept["result"] = compile_entries(source)
        once.count += 1
        assert list(kept["result"][0]) == list(signatures(source))
        return kept["result"]

    return once


@pytest.fixture
def builds(monkeypatch, compiled):
    """Number of compilations so far in this test."""
    compiled.count = 0
    monkeypatch.setattr(cache, "compile_entries", compiled)
    return lambda: compiled.count


def rate_at_two(library) -> float:
    out = np.empty((1, 1))
    library.evaluate_dynamics(1, np.zeros(1), np.full((1, 1), 2.0), GIVEN, out)
    return float(out[0, 0])


def load_as_a_new_process() -> float:
    cache._loaded.clear()
    return rate_at_two(cache.load(SMALL))


def home(place: Path) -> Path:
    return place / SMALL.digest()


def test_second_process_compiles_nothing(fresh, builds):
    assert load_as_a_new_process() == -1.0
    assert load_as_a_new_process() == -1.0
    assert rate_at_two(cache.load(SMALL)) == -1.0
    assert builds() == 1


def test_another_model_of_the_same_text_compiles_nothing(fresh, builds):
    """Names of states and parameters are in no kernel: what was compiled for one serves the other, unless it is damaged."""
    renamed = KernelSpec(pz.Model(["y"], ["-decay*y"], parameters=["decay"]), SMALL.scheme, SMALL.fragments)
    twice = KernelSpec(pz.Model(["y"], ["-2*decay*y"], parameters=["decay"]), SMALL.scheme, SMALL.fragments)
    assert SMALL.source("compiled") == renamed.source("compiled") != twice.source("compiled")
    load_as_a_new_process()
    assert rate_at_two(cache.load(renamed)) == -1.0
    assert builds() == 1
    assert sorted(p.name for p in fresh.iterdir()) == sorted([SMALL.digest(), renamed.digest()])
    cache.load(twice)
    assert builds() == 2
    for kept in (SMALL, renamed):
        flip_a_bit(fresh / kept.digest())
    cache._loaded.clear()
    assert rate_at_two(cache.load(renamed)) == -1.0
    assert builds() == 3


def edited(change):
    def damage(place: Path) -> None:
        manifest = json.loads((place / "manifest.json").read_text())
        change(manifest)
        (place / "manifest.json").write_text(json.dumps(manifest))

    return damage


def object_file(place: Path) -> Path:
    return place / "evaluate_dynamics.o"


def flip_a_bit(place: Path) -> None:
    data = bytearray(object_file(place).read_bytes())
    data[len(data) // 2] ^= 4
    object_file(place).write_bytes(data)


def other_code_with_its_own_checksum(manifest) -> None:
    manifest["objects"]["evaluate_dynamics"] = hashlib.sha256(b"").hexdigest()


DAMAGE = {
    "object truncated": lambda p: object_file(p).write_bytes(object_file(p).read_bytes()[:100]),
    "object empty": lambda p: object_file(p).write_bytes(b""),
    "object with a flipped bit": flip_a_bit,
    "object missing": lambda p: object_file(p).unlink(),
    "object is a folder": lambda p: (object_file(p).unlink(), object_file(p).mkdir()),
    "manifest missing": lambda p: (p / "manifest.json").unlink(),
    "manifest empty": lambda p: (p / "manifest.json").write_text(""),
    "manifest truncated": lambda p: (p / "manifest.json").write_text((p / "manifest.json").read_text()[:50]),
    "manifest not text": lambda p: (p / "manifest.json").write_bytes(b"\xff\xfe\x00"),
    "manifest not JSON": lambda p: (p / "manifest.json").write_text("hello"),
    "manifest another JSON": lambda p: (p / "manifest.json").write_text("[1, 2]"),
    "manifest null": lambda p: (p / "manifest.json").write_text("null"),
    "manifest nested deep": lambda p: (p / "manifest.json").write_text("[" * 100_000),
    "manifest of wrong types": lambda p: (p / "manifest.json").write_text('{"objects": 3, "symbols": "x", "seal": null}'),
    "checksum edited": edited(other_code_with_its_own_checksum),
    "kinds edited": edited(lambda m: m["symbols"]["evaluate_dynamics"][1].reverse()),
    "entry left out": edited(lambda m: m["objects"].pop("evaluate_dynamics_jacobian")),
    "seal edited": edited(lambda m: m.update(seal="0" * 64)),
    "seal left out": edited(lambda m: m.pop("seal")),
    "all gone but the folder": lambda p: [f.unlink() for f in p.iterdir()],
    "a file in place of the folder": lambda p: (shutil.rmtree(p), p.write_text("x")),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_noticed_and_mended(fresh, builds, name):
    load_as_a_new_process()
    DAMAGE[name](home(fresh))
    assert load_as_a_new_process() == -1.0
    assert builds() == 2
    assert load_as_a_new_process() == -1.0
    assert builds() == 2
    assert sorted(p.name for p in fresh.iterdir()) == [SMALL.digest()]  # nothing half-made is left behind


def test_a_failed_build_leaves_nothing(fresh, monkeypatch):
    def fail(source):
        raise RuntimeError("no compiler today")

    monkeypatch.setattr(cache, "compile_entries", fail)
    with pytest.raises(RuntimeError, match="no compiler"):
        cache.load(SMALL)
    assert list(fresh.iterdir()) == []


def test_leftovers_of_killed_builds_are_swept_up(fresh, builds):
    """Young ones too, but for those of a process that is still at work."""
    for name, age in ((".building-old", 7200), (".damaged-old", 7200), (".building-young", 60), (".damaged-young", 1)):
        (fresh / name).mkdir(parents=True)
        (fresh / name / "kernels.py").touch()
        (fresh / name).chmod(0o700)
        os.utime(fresh / name, times=(time.time() - age,) * 2)
    fresh.chmod(0o700)
    with folder.writable_folder().new(".building-") as (alive, _):
        load_as_a_new_process()
        assert sorted(p.name for p in fresh.iterdir()) == sorted([alive, SMALL.digest()])


def test_without_locks_young_leftovers_stay(fresh, builds, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    for name, age in ((".building-old", 7200), (".building-young", 60)):
        (fresh / name).mkdir(parents=True, mode=0o700)
        os.utime(fresh / name, times=(time.time() - age,) * 2)
    fresh.chmod(0o700)
    load_as_a_new_process()
    assert sorted(p.name for p in fresh.iterdir()) == [".building-young", SMALL.digest()]


@pytest.mark.skipif(sys.platform == "win32", reason="folders that are open are not removed")
def test_a_folder_that_was_swept_before_it_was_locked_is_made_again(fresh, builds, monkeypatch):
    """Between its making and its locking, another process may find it without a lock."""
    real, removed = folder.lock, []

    def lock_late(handle, wait):
        if not removed:
            (young,) = fresh.iterdir()
            young.rmdir()
            removed.append(young)
        return real(handle, wait)

    monkeypatch.setattr(folder, "lock", lock_late)
    load_as_a_new_process()
    assert len(removed) == 1
    assert [p.name for p in fresh.iterdir()] == [SMALL.digest()]


def test_finished_by_another_process_meanwhile(fresh, builds, monkeypatch):
    """The one that comes second finds the place taken by an equal kernel, and is content."""
    monkeypatch.setattr(cache, "kept_of_text", lambda *_: None)  # it looked before the other was done
    load_as_a_new_process()
    cache._build(SMALL, folder.writable_folder(), SMALL.digest())
    assert builds() == 2
    assert load_as_a_new_process() == -1.0
    assert builds() == 2
    assert sorted(p.name for p in fresh.iterdir()) == [SMALL.digest()]


# ---- the folder ------------------------------------------------------------------------------------------------------


def test_folder_is_made_for_us_alone(fresh, builds):
    load_as_a_new_process()
    assert fresh.stat().st_mode & 0o777 == 0o700
    assert home(fresh).stat().st_mode & 0o777 == 0o700


def warned_once() -> str:
    """Message of the one warning that three loads give."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(3):
            assert load_as_a_new_process() == -1.0
    assert len(caught) == 1, [str(w.message) for w in caught]
    return str(caught[0].message)


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777, 0o1777])
def test_folder_that_others_can_write_to_is_not_used(fresh, builds, mode):
    """Nor is it changed: it may be anybody's, such as /tmp itself."""
    fresh.mkdir()
    fresh.chmod(mode)
    message = warned_once()
    assert str(fresh) in message
    assert "others can write" in message
    assert fresh.stat().st_mode & 0o7777 == mode
    assert list(fresh.iterdir()) == []


def test_folder_that_others_can_read_is_used(fresh, builds):
    fresh.mkdir(mode=0o755)
    load_as_a_new_process()
    assert home(fresh).is_dir()


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give folders away")
def test_foreign_folder_is_not_used(fresh, builds):
    fresh.mkdir()
    os.chown(fresh, 65534, 65534)
    assert "belongs to another user" in warned_once()
    assert list(fresh.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="users are told apart on POSIX only")
def test_foreign_folder_is_told_by_its_owner(fresh, builds, monkeypatch):
    fresh.mkdir()
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert "belongs to another user" in warned_once()


def test_link_to_our_own_folder_is_followed(fresh, builds, tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    fresh.symlink_to(tmp_path / "elsewhere")
    load_as_a_new_process()
    load_as_a_new_process()
    assert builds() == 1
    assert home(tmp_path / "elsewhere").is_dir()


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give links away")
def test_link_that_another_user_laid_is_not_followed(fresh, builds, tmp_path):
    (tmp_path / "ours").mkdir(mode=0o700)
    fresh.symlink_to(tmp_path / "ours")
    os.chown(fresh, 65534, 65534, follow_symlinks=False)
    assert "belongs to another user" in warned_once()
    assert list((tmp_path / "ours").iterdir()) == []


def test_link_to_a_folder_that_others_can_write_to(fresh, builds, tmp_path):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    fresh.symlink_to(tmp_path / "open")
    assert "others can write" in warned_once()
    assert list((tmp_path / "open").iterdir()) == []


def test_link_to_nowhere(fresh, builds, tmp_path):
    fresh.symlink_to(tmp_path / "nowhere" / "at all")
    warned_once()


def test_a_file_where_the_folder_should_be(fresh, builds):
    fresh.write_text("not a folder")
    warned_once()
    assert fresh.read_text() == "not a folder"


def unwritable(monkeypatch, place: Path) -> None:
    """Make the folder read-only, for root too."""
    make = folder.tempfile.TemporaryFile

    def refuse(*args, **options):
        if Path(options.get("dir") or ".") == place:
            raise PermissionError(13, "Permission denied", str(place))
        return make(*args, **options)

    monkeypatch.setattr(folder.tempfile, "TemporaryFile", refuse)
    place.chmod(0o500)


def test_read_only_folder_that_holds_the_kernel_is_read(fresh, builds, monkeypatch):
    load_as_a_new_process()
    unwritable(monkeypatch, fresh)
    forget()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_as_a_new_process() == -1.0
    assert builds() == 1


def test_read_only_folder_without_the_kernel(fresh, builds, monkeypatch):
    fresh.mkdir(mode=0o700)
    unwritable(monkeypatch, fresh)
    assert "Permission denied" in warned_once()
    assert list(fresh.iterdir()) == []


def place_and_reason():
    found, reason = folder.private_folder()
    return found and found.path, reason


def test_order_of_places(monkeypatch, tmp_path):
    for name in ("PIAZZI_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    places = [tmp_path / "home" / ".cache" / "piazzi"]
    forget()
    assert place_and_reason() == (places[0], "")
    for name, value, place in (("XDG_CACHE_HOME", "xdg", "xdg/piazzi"), ("PIAZZI_CACHE", "own", "own")):
        monkeypatch.setenv(name, str(tmp_path / value))
        forget()
        assert place_and_reason() == (tmp_path / place, "")
    forget()


# ---- what a kernel depends on ----------------------------------------------------------------------------------------


def test_editing_any_source_of_a_kernel_is_noticed(monkeypatch, tmp_path):
    """Each file of the expressions, the model and the kernels, by one byte; of the fragments, those of the kernel alone."""
    shutil.copytree(PACKAGE, tmp_path / "piazzi", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(spec, "HERE", tmp_path / "piazzi" / "kernels")
    monkeypatch.setattr(spec, "_surroundings", spec._surroundings.__wrapped__)
    monkeypatch.setattr(spec, "_own_fragment", spec._own_fragment.__wrapped__)
    files = [f for stage in ("expressions", "model", "kernels") for f in sorted((tmp_path / "piazzi" / stage).rglob("*.py"))]
    own = {f"{name}.py" for name in SMALL.fragments}
    assert {f.name for f in files if f.parent.name == "fragments"} > own
    before = SMALL.digest()
    assert before == SMALL.digest()
    seen = {before}
    for file in files:
        file.write_text(file.read_text() + "\n")
        after = SMALL.digest()
        if file.name == "vocabulary.py" or (file.parent.name == "fragments" and file.name not in own):
            assert after in seen, f"{file.name} is no part of the kernel"
        else:
            assert after not in seen, f"an edit of {file.name} goes unnoticed"
        seen.add(after)


def test_digest_tells_models_schemes_and_fragments_apart():
    other = pz.Model(["x"], ["-k*x*x"], parameters=["k"])
    specs = [
        SMALL,
        KernelSpec(other, SMALL.scheme, SMALL.fragments),
        KernelSpec(MODEL, pz.RungeKutta4().scheme, SMALL.fragments),
        KernelSpec(MODEL, SMALL.scheme, ("transition",)),
    ]
    assert len({s.digest() for s in specs}) == len(specs)
    assert KernelSpec(pz.Model(["x"], ["-k*x"], parameters=["k"]), SMALL.scheme, SMALL.fragments).digest() == SMALL.digest()


# ---- whole processes -------------------------------------------------------------------------------------------------

RATES = """
import sys
import piazzi as pz
model = pz.Model(["x"], ["-k*x"], parameters=["k"])
problem = pz.Problem(model, pz.Gaussian(1.0, 0.1), parameters={"k": 0.5}, integrator=pz.Taylor(1))
print(repr(float(problem.dynamics([2.0])[0])), *sorted({"numba", "sympy"} & set(sys.modules)))
"""

FILTER = """
import piazzi as pz
model = pz.Model(["x"], ["-k*x"], [pz.Sensor("s", ["x**2"])], ["k"])
problem = pz.Problem(model, pz.Gaussian(1.0, 0.1), 0.01, pz.Station("s", "s", 0.1), {"k": 0.5}, pz.Taylor(1))
estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 1.0], [1.1, 0.4]))
print(repr(float(estimate.mean[1, 0])))
"""


def environment(place: Path, **more: str) -> dict[str, str]:
    return {**os.environ, "PIAZZI_CACHE": str(place), **more}


def start(code: str, env: dict[str, str], **options) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", code], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options
    )


def finished(process: subprocess.Popen) -> str:
    out, err = process.communicate(timeout=HANGS)
    assert process.returncode == 0, err
    assert "Traceback" not in err
    return out


WATCHFUL = """
import sys
def hook(event, args):
    if event.startswith("pickle."):
        raise RuntimeError(f"unpickling {args}")
sys.addaudithook(hook)
"""


def test_two_processes_at_once_and_a_warm_third(tmp_path):
    """On an empty cache both succeed; a warm process imports neither Numba nor SymPy and unpickles nothing."""
    place = tmp_path / "cache"
    results = [finished(p) for p in [start(RATES, environment(place)) for _ in range(2)]]
    assert [r.split()[0] for r in results] == ["-1.0", "-1.0"]
    assert len(list(place.iterdir())) == 1
    assert finished(start(WATCHFUL + RATES, environment(place))) == "-1.0\n"


def test_machine_without_a_writable_home(tmp_path):
    """One line of warning, and the work is done."""
    blocked = tmp_path / "home"
    blocked.write_text("a file, so that no folder can be made in it")
    env = {k: v for k, v in os.environ.items() if k not in ("PIAZZI_CACHE", "XDG_CACHE_HOME")} | {"HOME": str(blocked)}
    process = start(RATES, env)
    out, err = process.communicate(timeout=HANGS)
    assert process.returncode == 0, err
    assert out.split()[0] == "-1.0"
    assert err.count("UserWarning") == 1
    assert "Set PIAZZI_CACHE" in err


@pytest.mark.slow
def test_edited_kernel_file_is_compiled_anew(tmp_path):
    """End to end, in a copy of the package whose filter is made to fail."""
    shutil.copytree(PACKAGE, tmp_path / "src" / "piazzi", ignore=shutil.ignore_patterns("__pycache__"))
    env = environment(tmp_path / "cache", PYTHONPATH=str(tmp_path / "src"))
    before = finished(start(FILTER, env)).split()[0]
    assert finished(start(FILTER, env)).split()[0] == before
    fragment = tmp_path / "src" / "piazzi" / "kernels" / "fragments" / "update_components.py"
    text = fragment.read_text()
    assert "d = d + (nu[i] - h @ d) * K" in text
    fragment.write_text(text.replace("d = d + (nu[i] - h @ d) * K", "d = d + (nu[i] - h @ d) * K * 2.0"))
    assert finished(start(FILTER, env)).split()[0] != before
    assert len(list((tmp_path / "cache").iterdir())) == 2


BECOME_NOBODY = """
import os, warnings
import llvmlite.binding, piazzi.estimate
from piazzi.kernels import library, spec
spec._surroundings()
warnings.simplefilter("error")
os.setuid(65534)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs root to become another user")
def test_as_another_user_with_a_read_only_cache(tmp_path):
    """A user who may read a finished cache of his own but not write to it."""
    place = tmp_path / "cache"
    finished(start(RATES, environment(place)))
    for path in [tmp_path, *tmp_path.parents]:
        if path.is_relative_to("/tmp") and path != Path("/tmp"):
            path.chmod(path.stat().st_mode | 0o055)
    for path in [place, *place.rglob("*")]:
        os.chown(path, 65534, 65534)
        path.chmod(0o500 if path.is_dir() else 0o400)
    assert finished(start(BECOME_NOBODY + RATES, environment(place))) == "-1.0\n"
