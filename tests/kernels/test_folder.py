"""Nobody else can put code into the cache of kernels, by whatever way."""

import hashlib
import json
import os
import shutil
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi.kernels import KernelSpec, cache, folder, ownership
from piazzi.kernels.bundle import Given
from tests.waiting import HANGS

MODEL = pz.Model(["x"], ["-k*x"], parameters=["k"])
GIVEN = Given(parameters=np.full(1, 0.5), manoeuvres=np.zeros(1), data=np.zeros(1))
SMALL = KernelSpec(MODEL, pz.Taylor(1).scheme, ("transition", "rates"))
NOBODY = 65534

posix = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="users are told apart on POSIX only")
as_root = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")


def forget():
    cache._loaded.clear()
    folder.private_folder.cache_clear()
    folder.writable_folder.cache_clear()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A finished cache."""
    place = tmp_path_factory.mktemp("made") / "cache"
    before = os.environ["PIAZZI_CACHE"]
    os.environ["PIAZZI_CACHE"] = str(place)
    kept, cache._loaded = cache._loaded, {}
    forget()
    try:
        cache.load(SMALL)
    finally:
        os.environ["PIAZZI_CACHE"], cache._loaded = before, kept
        folder.private_folder.cache_clear()
        folder.writable_folder.cache_clear()
    return place


@pytest.fixture
def place(made, monkeypatch, tmp_path):
    """A copy of it, which this process takes for its own."""
    copied = tmp_path / "users" / "cache"
    copied.parent.mkdir(mode=0o755)
    shutil.copytree(made, copied)
    monkeypatch.setenv("PIAZZI_CACHE", str(copied))
    monkeypatch.setattr(cache, "_loaded", {})
    forget()
    yield copied
    forget()


@pytest.fixture
def builds(made, monkeypatch):
    """The compilations so far, which take what was compiled once."""
    count = []

    def compiled(source):
        count.append(source)
        home = made / SMALL.digest()
        manifest = json.loads((home / "manifest.json").read_text())
        return {n: (home / f"{n}.o").read_bytes() for n in manifest["objects"]}, manifest["symbols"]

    monkeypatch.setattr(cache, "compile_entries", compiled)
    return count


def loads(builds) -> int:
    """Compilations that a new process would need; what it runs is right."""
    builds.clear()
    forget()
    out = np.empty((1, 1))
    cache.load(SMALL).evaluate_dynamics(1, np.zeros(1), np.full((1, 1), 2.0), GIVEN, out)
    assert out[0, 0] == -1.0
    return len(builds)


def warned(builds) -> str:
    """The one warning of a process that may keep nothing, which compiles."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert loads(builds) == 1
    (warning,) = caught
    return str(warning.message)


def test_what_is_ours_alone_is_loaded(place, builds):
    assert loads(builds) == 0


PLANTED = {
    "a kernel of another user": lambda home: os.chown(home, NOBODY, NOBODY),
    "a manifest of another user": lambda home: os.chown(home / "manifest.json", NOBODY, NOBODY),
    "code of another user": lambda home: os.chown(home / "evaluate_dynamics.o", NOBODY, NOBODY),
    "a kernel that others can write to": lambda home: home.chmod(0o777),
    "code that others can write to": lambda home: (home / "evaluate_dynamics.o").chmod(0o666),
    "code that the group can write to": lambda home: (home / "evaluate_dynamics.o").chmod(0o660),
    "a link to a kernel": lambda home: (home.rename(home.with_name("elsewhere")), home.symlink_to("elsewhere")),
    "a link to code": lambda home: (
        (home / "evaluate_dynamics.o").rename(home / "other.o"),
        (home / "evaluate_dynamics.o").symlink_to("other.o"),
    ),
    "a pipe": lambda home: ((home / "manifest.json").unlink(), os.mkfifo(home / "manifest.json")),
}


@as_root
@pytest.mark.parametrize("what", PLANTED)
def test_what_was_planted_is_not_run(place, builds, what):
    """As after a time at which others could write to the folder; sound checksums are no secret."""
    PLANTED[what](place / SMALL.digest())
    assert loads(builds) == 1
    assert loads(builds) == 0  # what was planted has made way


@posix
def test_a_kernel_under_the_name_of_another_is_not_run(place, builds):
    """Ours, whole, and sealed; but of another model."""
    home = place / SMALL.digest()
    manifest = json.loads((home / "manifest.json").read_text())
    body = json.dumps(["0" * 32, *(manifest[name] for name in ("objects", "symbols", "calls", "text"))], sort_keys=True)
    manifest["seal"] = hashlib.sha256(body.encode()).hexdigest()
    (home / "manifest.json").write_text(json.dumps(manifest))
    assert loads(builds) == 1


@posix
def test_a_folder_that_takes_the_checked_ones_place_is_not_read(place, builds, made, tmp_path):
    """Whoever can write to the parent may rename it at any time: what was opened stays what is read."""
    assert loads(builds) == 0
    place.rename(tmp_path / "users" / "old")
    shutil.copytree(made, place)
    (place / SMALL.digest() / "manifest.json").unlink()
    cache._loaded.clear()
    cache.load(SMALL)
    assert builds == []


@posix
@pytest.mark.parametrize("mode", [0o777, 0o757])
def test_a_folder_in_one_that_others_can_write_to_is_not_used(place, builds, mode):
    place.parent.chmod(mode)
    message = warned(builds)
    assert f"others can write to {place.parent}" in message
    assert "chmod" not in message


@posix
def test_nor_is_one_that_is_still_to_be_made(place, builds):
    shutil.rmtree(place)
    place.parent.chmod(0o777)
    assert "others can write" in warned(builds)
    assert not place.exists()


@as_root
def test_a_group_is_others_unless_it_is_the_users_own(place, builds):
    place.parent.chmod(0o775)
    assert loads(builds) == 0  # the group root, with root alone in it
    os.chown(place.parent, 0, NOBODY)
    assert "others can write" in warned(builds)


@posix
def test_the_sticky_bit_keeps_others_from_what_is_not_theirs(place, builds):
    place.parent.chmod(0o1777)
    assert loads(builds) == 0


@as_root
def test_a_link_on_the_way_counts_with_where_it_leads(place, builds, tmp_path, monkeypatch):
    (tmp_path / "way").symlink_to(place.parent)
    monkeypatch.setenv("PIAZZI_CACHE", str(tmp_path / "way" / "cache"))
    assert loads(builds) == 0
    place.parent.chmod(0o777)
    assert "others can write" in warned(builds)
    place.parent.chmod(0o755)
    os.chown(tmp_path / "way", NOBODY, NOBODY, follow_symlinks=False)
    assert "another user" in warned(builds)


@posix
def test_links_in_a_circle(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OSError, match="too many links"):
        ownership.check_way(tmp_path / "a" / "cache")


@posix
def test_advice_is_to_remove(place, builds):
    """To take away the right to write leaves what was written."""
    place.chmod(0o777)
    message = warned(builds)
    assert "others can write" in message
    assert "remove it" in message
    assert "chmod" not in message


@as_root
def test_root_makes_nothing_in_the_home_of_a_user(builds, tmp_path, monkeypatch):
    """`sudo` with the user's HOME: a folder of root's there would be of no use to the user from then on."""
    home = tmp_path / "home"
    home.mkdir()
    os.chown(home, NOBODY, NOBODY)
    monkeypatch.setenv("HOME", str(home))
    for name in ("PIAZZI_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(cache, "_loaded", {})
    assert f"lies behind {home}, which belongs to another user" in warned(builds)
    assert list(home.iterdir()) == []
    forget()


@posix
def test_folders_on_the_way_are_made_for_us_alone(builds, tmp_path, monkeypatch):
    """Whatever the mask of the process: it made ~/.cache open to everybody under a mask of 0."""
    monkeypatch.setenv("PIAZZI_CACHE", str(tmp_path / "a" / "b" / "c"))
    monkeypatch.setattr(cache, "_loaded", {})
    before = os.umask(0)
    try:
        assert loads(builds) == 1
    finally:
        os.umask(before)
        forget()
    for path in (tmp_path / "a", *(tmp_path / "a").rglob("*")):
        assert path.stat().st_mode & 0o077 == 0, path


@pytest.mark.parametrize("below", [True, False])
def test_systems_without_users_keep_kernels_in_the_users_own_folder_only(place, builds, tmp_path, monkeypatch, below):
    """As on Windows: no numbers of users, no folders that are opened."""
    monkeypatch.delattr(os, "geteuid", raising=False)
    monkeypatch.setattr(folder, "_THROUGH_HANDLES", False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path if below else tmp_path / "elsewhere")
    if below:
        assert loads(builds) == 0
        shutil.rmtree(place)
        assert [loads(builds), loads(builds)] == [1, 0]
    else:
        assert "cannot be told on this system" in warned(builds)


# ---- threads ---------------------------------------------------------------------------------------------------------


def test_sixteen_threads_make_each_kernel_once(monkeypatch):
    made, ready = [], threading.Barrier(16)

    def make(spec):
        made.append(spec)
        time.sleep(0.05)
        return object()

    monkeypatch.setattr(cache, "_loaded", {})
    monkeypatch.setattr(cache, "_from_disk_or_built", make)
    specs = [KernelSpec(MODEL, SMALL.scheme, (name,)) for name in ("transition", "rates", "epoch")]

    def load(i):
        ready.wait()
        return [cache.load(spec) for spec in specs]

    with ThreadPoolExecutor(16) as threads:
        results = list(threads.map(load, range(16)))
    assert sorted(map(id, made)) == sorted(map(id, specs))
    assert all(found == results[0] for found in results)


@pytest.mark.slow
def test_sixteen_cold_threads_compile_for_real(place, monkeypatch):
    """One of sixteen had "AST constructor recursion depth mismatch" of CPython's parser, the others took 205 s."""
    shutil.rmtree(place)
    monkeypatch.setattr(cache, "_loaded", {})
    count, compile_entries = [], cache.compile_entries
    monkeypatch.setattr(cache, "compile_entries", lambda *a: (count.append(a), compile_entries(*a))[1])
    with ThreadPoolExecutor(16) as threads:
        entries = list(threads.map(lambda _: cache.load(SMALL), range(16)))
    assert len(count) == 1
    assert all(found is entries[0] for found in entries)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_does_not_wait_for_a_thread_that_it_does_not_have(place, made):
    """Forked while a kernel was being made."""
    held, done = threading.Event(), threading.Event()

    def hold():
        with cache._making:
            held.set()
            done.wait()

    thread = threading.Thread(target=hold)
    thread.start()
    held.wait()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns of threads and forks
        child = os.fork()
    if not child:
        try:
            cache.load(SMALL)
            os._exit(0)
        finally:
            os._exit(1)
    end = time.monotonic() + HANGS
    while not (status := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < end:
        time.sleep(0.01)
    if not status[0]:
        os.kill(child, 9)
        os.waitpid(child, 0)
    done.set()
    thread.join()
    assert status == (child, 0)
