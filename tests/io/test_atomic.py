"""Files appear whole or not at all."""

import errno
import os
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from piazzi.io import atomic
from piazzi.io.atomic import atomic_path, check_writable
from tests.waiting import HANGS


def test_a_finished_file_takes_the_place_of_the_old_one(tmp_path):
    target = tmp_path / "out.nc"
    target.write_text("old")
    target.chmod(0o640)
    with atomic_path(target) as work:
        assert work.parent == tmp_path
        assert work.suffix == ".nc"
        work.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ["out.nc"]


def test_a_new_file_has_the_usual_permissions(tmp_path):
    before = os.umask(0o027)
    try:
        with atomic_path(tmp_path / "new") as work:
            work.write_text("")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_nothing_is_left_of_a_file_that_failed(tmp_path, error):
    (tmp_path / "out").write_text("old")
    with pytest.raises(error), atomic_path(tmp_path / "out") as work:
        work.write_text("half")
        raise error
    assert os.listdir(tmp_path) == ["out"]
    assert (tmp_path / "out").read_text() == "old"


def test_a_link_is_followed(tmp_path):
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    with atomic_path(tmp_path / "link") as work:
        work.write_text("new")
    assert (tmp_path / "real").read_text() == "new"
    assert (tmp_path / "link").is_symlink()


def test_what_is_no_file_is_written_to_and_stays_what_it_is():
    with atomic_path(os.devnull) as work:
        work.write_text("gone")
    assert stat.S_ISCHR(os.stat(os.devnull).st_mode)


def test_places_that_cannot_be_written_are_told(tmp_path):
    for path in (tmp_path, tmp_path / "no" / "file", "/"):
        with pytest.raises(OSError, match="cannot write"):
            check_writable(path)
    check_writable(tmp_path / "file")
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_told(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError, match="cannot write"):
        check_writable(tmp_path / "file")


def leftover(target):
    """The temporary file of a writer that is killed in the middle."""
    code = f"""
import os, signal
from piazzi.io.atomic import atomic_path
with atomic_path({str(target)!r}) as work:
    work.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], timeout=HANGS).returncode == -signal.SIGKILL
    (left,) = (path for path in target.parent.iterdir() if path.name.startswith(f".{target.stem}"))
    assert left.read_text() == "half"
    return left


def test_what_killed_writers_left_goes_with_the_next_one(tmp_path):
    target = tmp_path / "s.nc"
    left = leftover(target)
    others = [".s-abcd1234.nc", ".t.piazzi-abcd1234.nc", ".s.piazzi-abcd1234.csv", ".s.piazzi-short.nc", "s.piazzi-abcd1234.nc"]
    for name in others:
        (tmp_path / name).write_text("somebody else's")
    with atomic_path(target) as work:
        work.write_text("whole")
        assert not left.exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*others, "s.nc"])


def test_what_a_living_writer_is_writing_stays(tmp_path):
    """Of this process or of another."""
    target = tmp_path / "s.nc"
    with atomic_path(target) as first:
        first.write_text("first")
        code = f"from piazzi.io.atomic import atomic_path\nwith atomic_path({str(target)!r}) as work: work.write_text('second')"
        assert subprocess.run([sys.executable, "-c", code], timeout=HANGS).returncode == 0
        assert target.read_text() == "second"
        assert first.read_text() == "first"
    assert target.read_text() == "first"
    assert os.listdir(tmp_path) == ["s.nc"]


def test_a_file_that_was_swept_before_it_was_locked_is_made_again(tmp_path, monkeypatch):
    """Between its making and its locking, another process may find it without a lock."""
    real, removed = atomic.lock, []

    def lock_late(handle, wait):
        if not removed:
            (young,) = tmp_path.iterdir()
            young.unlink()
            removed.append(young)
        return real(handle, wait)

    monkeypatch.setattr(atomic, "lock", lock_late)
    with atomic_path(tmp_path / "s.nc") as work:
        work.write_text("whole")
        assert work != removed[0]
    assert (tmp_path / "s.nc").read_text() == "whole"


def test_without_locks_nothing_is_swept(tmp_path, monkeypatch):
    left = leftover(tmp_path / "s.nc")
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with atomic_path(tmp_path / "s.nc") as work:
        work.write_text("whole")
    assert left.read_text() == "half"
    assert (tmp_path / "s.nc").read_text() == "whole"


@pytest.mark.skipif(sys.platform == "win32", reason="owners and links of POSIX")
@pytest.mark.parametrize("content", ["new", "a longer new one", ""])
def test_hard_links_stay_links_to_what_was_written(tmp_path, content):
    """As `cp` writes: both names have the new content, and the permissions stay, but for the right to run as the owner."""
    target, link = tmp_path / "out", tmp_path / "link"
    target.write_text("old one")
    link.hardlink_to(target)
    target.chmod(0o4640)
    before = target.stat()
    with atomic_path(target) as work:
        work.write_text(content)
    assert link.read_text() == target.read_text() == content
    assert (target.stat().st_ino, target.stat().st_nlink) == (before.st_ino, 2)
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert sorted(os.listdir(tmp_path)) == ["link", "out"]


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="room cannot be asked for")
def test_a_linked_file_for_which_there_is_no_room_stays(tmp_path, monkeypatch):
    def full(handle, start, size):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (tmp_path / "out").write_text("old")
    (tmp_path / "link").hardlink_to(tmp_path / "out")
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match="No space left") as caught, atomic_path(tmp_path / "out") as work:
        work.write_text("a longer one")
    assert caught.value.filename == str(tmp_path / "out")
    assert (tmp_path / "link").read_text() == "old"
    assert sorted(os.listdir(tmp_path)) == ["link", "out"]


@pytest.mark.parametrize("mode", [0o4755, 0o2755, 0o1644])
def test_the_right_to_run_as_the_owner_does_not_stay(tmp_path, mode):
    target = tmp_path / "out"
    target.write_text("old")
    target.chmod(mode)
    with atomic_path(target) as work:
        work.write_text("new")
    assert stat.S_IMODE(target.stat().st_mode) == mode & 0o777


ROOT = pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root may act as others")
NOBODY = 65534


@pytest.fixture
def shared():
    """A folder that everybody may write in; those of pytest are its user's."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o777)
    yield folder
    shutil.rmtree(folder)


def as_nobody(action):
    """What an action returns in a process of another user: its one line of text."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            text = repr(action())
        except BaseException as error:
            text = f"{type(error).__name__}: {error}"
        os.write(writing, text.encode())
        os._exit(0)
    os.close(writing)
    os.waitpid(child, 0)
    with open(reading, "rb") as pipe:
        return pipe.read().decode()


def write(target, content="new"):
    with atomic_path(target) as work:
        work.write_text(content)


@ROOT
def test_the_owner_stays(shared):
    """Root writes a file of somebody else, as under sudo."""
    target = shared / "out"
    target.write_text("old")
    os.chown(target, NOBODY, NOBODY)
    target.chmod(0o640)
    write(target)
    found = target.stat()
    assert (found.st_uid, found.st_gid, stat.S_IMODE(found.st_mode)) == (NOBODY, NOBODY, 0o640)
    assert target.read_text() == "new"


@ROOT
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_file_of_another_owner_is_written_into_where_it_may_be(shared):
    target = shared / "out"
    target.write_text("old")
    target.chmod(0o666)
    assert as_nobody(lambda: write(target)) == "None"
    assert target.read_text() == "new"
    assert (target.stat().st_uid, stat.S_IMODE(target.stat().st_mode)) == (0, 0o666)
    target.chmod(0o644)
    assert as_nobody(lambda: write(target, "newer")) == f"PermissionError: cannot write {target}: it is read-only"
    assert target.read_text() == "new"
    assert os.listdir(shared) == ["out"]


@ROOT
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_read_only_file_is_refused_for_its_owner_too(shared):
    target = shared / "out"
    target.write_text("old")
    os.chown(target, NOBODY, NOBODY)
    target.chmod(0o444)
    assert as_nobody(lambda: write(target)) == f"PermissionError: cannot write {target}: it is read-only"
    assert target.read_text() == "old"


@ROOT
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_leftovers_of_others_stay(shared):
    left = leftover(shared / "s.nc")
    os.chown(left, NOBODY, NOBODY)
    write(shared / "s.nc")
    assert left.exists()


def test_the_folder_is_synced_after_a_file_was_moved_there(tmp_path, monkeypatch):
    """Else a power failure may leave the old name, or none."""
    done, sync, replace = [], os.fsync, os.replace

    def seen_sync(handle):
        done.append("folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "file")
        sync(handle)

    def seen_replace(*arguments):
        done.append("moved")
        replace(*arguments)

    monkeypatch.setattr(os, "fsync", seen_sync)
    monkeypatch.setattr(os, "replace", seen_replace)
    write(tmp_path / "out")
    assert done == ["file", "moved", "folder"]


def test_the_mask_of_other_threads_is_left_alone(tmp_path, monkeypatch):
    """To ask for it is to set it, for the whole process: a file that another thread makes then is open to everybody."""

    def forbidden(mask):
        raise AssertionError("the mask of the process was touched")

    monkeypatch.setattr(os, "umask", forbidden)
    with atomic_path(tmp_path / "new") as work:
        work.write_text("")
    (tmp_path / "usual").write_text("")
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_what_replaces_a_private_file_is_private_while_it_is_written(tmp_path):
    (tmp_path / "old").write_text("")
    (tmp_path / "old").chmod(0o600)
    with atomic_path(tmp_path / "old") as work:
        assert stat.S_IMODE(work.stat().st_mode) == 0o600
