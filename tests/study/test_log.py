"""The file of finished runs: whole records or none, whatever ends the process or fills the disk."""

import errno
import hashlib
import json
import os
import resource
import shutil
import struct
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from piazzi.study.log import Log
from piazzi.study.tasks import Piece, Task

SPECIFICATION = {"runs": 9}


def piece(first, count=3):
    rng = np.random.default_rng(first)
    arrays = {
        "a": rng.standard_normal((2, count, 4)),
        "b": rng.integers(0, 2, (2, count)).astype(np.uint8),
        "none": np.empty((2, 0)),
    }
    return Piece(Task(1, first, count), arrays, ((0, first, "why \u2026 \n"),))


def same(one, other):
    assert (one.task, one.messages) == (other.task, other.messages)
    for name, values in one.arrays.items():
        assert other.arrays[name].dtype == values.dtype
        assert_array_equal(other.arrays[name], values)


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "study.nc.runs"
    log = Log.create(path, SPECIFICATION)
    for first in (0, 3, 6):
        log.append(piece(first))
    log.close()
    return path


def test_pieces_come_back(path):
    log = Log.open(path)
    assert log.specification == SPECIFICATION
    for found, first in zip(log.pieces(), (0, 3, 6), strict=True):
        same(piece(first), found)
    log.close()


def test_cut_anywhere_leaves_the_whole_records_before(path, tmp_path):
    whole = path.read_bytes()
    log = Log.open(path)
    ends = [entry.offset for entry in log.entries] + [len(whole)]
    log.close()
    for length in {*range(ends[0], len(whole), 37), *ends, *(e - 1 for e in ends[1:])}:
        cut = tmp_path / "cut.runs"
        cut.write_bytes(whole[:length])
        log = Log.open(cut)
        count = sum(end <= length for end in ends[1:])
        assert [entry.task.first for entry in log.entries] == [0, 3, 6][:count]
        assert cut.stat().st_size == ends[count]
        log.append(piece(99))
        same(piece(99), log.read(log.entries[-1]))
        log.close()


def test_a_flipped_bit_is_found(path):
    data = bytearray(path.read_bytes())
    data[-5] ^= 1
    path.write_bytes(data)
    with pytest.warns(UserWarning, match="1 record damaged; 6 runs are whole"):
        log = Log.open(path)
    assert [entry.task.first for entry in log.entries] == [0, 3]
    log.close()
    assert path.with_name(path.name + ".damaged").read_bytes() == bytes(data)


def test_the_last_record_is_no_exception(path):
    """A bit of it flips anywhere: it is told and a copy kept, but where it looks as if it was never written to its end."""
    log = Log.open(path)
    last = log.entries[-1].offset
    log.close()
    whole = path.read_bytes()
    for at in (0, 7, 20, 47, 48, 60, len(whole) - last - 1):
        data = bytearray(whole)
        data[last + at] ^= 0x10
        path.write_bytes(data)
        with pytest.warns(UserWarning, match="1 record damaged; 6 runs are whole"):
            Log.open(path).close()
    for tail in (whole[last:-1], whole[last : last + 20], whole[last : last + 3], b"\0" * 500):
        path.write_bytes(whole[:last] + tail)
        Log.open(path).close()  # without a word: these runs were never said to be kept
        assert path.read_bytes() == whole[:last]


def test_a_copy_that_could_not_be_made_is_not_spoken_of(path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    data = bytearray(path.read_bytes())
    data[-5] ^= 1
    path.write_bytes(data)
    monkeypatch.setattr(shutil, "copyfile", full)
    with pytest.warns(UserWarning, match=r"\(no copy could be made: No space left on device\)"):
        Log.open(path).close()


@pytest.mark.filterwarnings("default:.*record damaged:UserWarning")
def test_damage_in_the_middle_costs_the_runs_that_were_there_only(path):
    log = Log.open(path)
    middle = log.entries[1].offset
    log.close()
    data = bytearray(path.read_bytes())
    data[middle + 60] ^= 1
    path.write_bytes(data)
    log = Log.open(path)
    assert [entry.task.first for entry in log.entries] == [0, 6]
    same(piece(6), log.read(log.entries[-1]))
    log.append(piece(3))
    log.close()
    again = Log.open(path)
    assert [entry.task.first for entry in again.entries] == [0, 6, 3]
    again.close()


@pytest.mark.parametrize("content", [b"", b"x", b"PZRUNS1\n" + b"\xff" * 100, b"\0" * 1000])
def test_another_file_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "other.runs"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="no runs of a study"):
        Log.open(path)
    assert path.read_bytes() == content


def test_only_one_process_at_a_time(path):
    log = Log.open(path)
    with pytest.raises(ValueError, match="another process is running this study"):
        Log.open(path)
    log.close()
    Log.open(path).close()


def test_a_full_disk_takes_nothing_away(path, monkeypatch):
    """Writes end in the middle of the record, as they do on a full disk."""
    log = Log.open(path)

    class Full:
        def __init__(self, file):
            self.file, self.room = file, 100

        def __getattr__(self, name):
            return getattr(self.file, name)

        def write(self, data):
            if not self.room:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            written = self.file.write(data[: self.room])
            self.room -= written
            return written

    log._file = Full(log._file)
    before = path.stat().st_size
    with pytest.raises(OSError, match="No space left on device") as caught:
        log.append(piece(50))
    assert caught.value.filename == str(path)
    assert path.stat().st_size == before
    log.close()
    again = Log.open(path)
    assert [entry.task.first for entry in again.entries] == [0, 3, 6]
    again.close()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_a_really_full_disk(monkeypatch, tmp_path):
    """/dev/full refuses every write, as a full disk does."""
    path = tmp_path / "study.nc.runs"
    os.symlink("/dev/full", path)
    with pytest.raises(OSError):
        Log.create(path, SPECIFICATION)
    assert shutil.disk_usage(tmp_path).total > 0


def test_windows_closes_before_it_removes(path, monkeypatch):
    """There, a file that is open cannot be removed (WinError 32)."""
    log, unlink = Log.open(path), type(path).unlink

    def unlink_as_windows_does(self, missing_ok=False):
        if not log._file.closed:
            raise PermissionError(13, "The process cannot access the file because it is being used by another process")
        unlink(self, missing_ok=missing_ok)

    monkeypatch.setattr(type(path), "unlink", unlink_as_windows_does)
    log.remove()
    assert not path.exists()


def test_windows_lock_keeps_others_out(path, monkeypatch):
    """Without fcntl: a byte far behind the end is locked, and the file is read from its start."""
    locked = set()

    def locking(handle, mode, count):
        at = os.lseek(handle, 0, os.SEEK_CUR)
        assert (mode, count) == (2, 1)
        assert os.fstat(handle).st_size < at < 2**31
        if at in locked:
            raise PermissionError(13, "Permission denied")
        locked.add(at)

    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    log = Log.open(path)
    assert [entry.task.first for entry in log.entries] == [0, 3, 6]
    with pytest.raises(ValueError, match="another process is running this study"):
        Log.open(path)
    log.close()


def test_systems_without_locks_do_without(path, monkeypatch):
    for name in ("fcntl", "msvcrt"):
        monkeypatch.setitem(sys.modules, name, None)
    log = Log.open(path)
    assert len(log.entries) == 3
    log.close()


def test_a_record_full_of_holes_is_looked_at_in_parts(path):
    """It declares a gigabyte, and the file has no byte of it on disk."""
    size = 2**30
    checksum = hashlib.sha256()
    header = json.dumps({"task": [1, 9, 1], "arrays": [["a", "|u1", [size]]], "messages": []}).encode()
    checksum.update(struct.pack("<Q", len(header)) + header)
    for _ in range(size >> 20):
        checksum.update(bytes(2**20))
    with open(path, "ab") as file:
        file.write(struct.pack("<8sQ32s", b"PZRUNS1\n", 8 + len(header) + size, checksum.digest()))
        file.write(struct.pack("<Q", len(header)) + header)
        file.truncate(file.tell() + size)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    log = Log.open(path)
    assert [entry.task.first for entry in log.entries] == [0, 3, 6, 9]
    log.close()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**18  # KiB


def resealed(path, change):
    """The log with the contents of its second record changed, and its sums right again."""
    from piazzi.study.log import _read, _record

    with open(path, "rb") as file:
        assert _read(file) is not None
        head_end = file.tell()
        header, body, _ = _read(file)
        rest = file.read()
    start = path.read_bytes()[:head_end]
    path.write_bytes(start + _record(*change(header, body)) + rest)


CHANGES = {
    "no task": lambda h, b: ({"tsk": [0, 0, 1]}, b),
    "list": lambda h, b: ([1, 2], b),
    "arrays": lambda h, b: (h | {"arrays": [["rmse"]]}, b),
    "kind": lambda h, b: (h | {"arrays": [[n, "O", s] for n, _, s in h["arrays"]]}, b),
    "messages": lambda h, b: (h | {"messages": ["x"]}, b),
    "run of a message": lambda h, b: (h | {"messages": [[0, 3, "of the next piece"]]}, b),
    "size": lambda h, b: (h, b[:-8]),
    "more than is": lambda h, b: (h | {"arrays": [["a", "<f8", [2**39] * 8]]}, b),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=list(CHANGES))
def test_records_with_right_sums_and_wrong_contents_are_damage(path, change):
    resealed(path, change)
    with pytest.warns(UserWarning, match="1 record damaged; 6 runs are whole"):
        again = Log.open(path)
    assert len(again.entries) == 2
    again.close()
    assert path.with_name(path.name + ".damaged").exists()


def test_a_bound_that_is_not_known_is_no_damage(path):
    log = Log.open(path)
    log.append(Piece(Task(1, 0, 0), {"bound": np.zeros(2)}, ((-1, -1, "why"),)))
    log.close()
    again = Log.open(path)  # without a warning
    assert [p.messages for p in again.pieces() if not p.task.count] == [((-1, -1, "why"),)]
    again.close()


def test_what_is_refused_by_its_specification_stays_as_it_is(path):
    path.write_bytes(path.read_bytes()[:-1] + b"damaged and torn")
    before = path.read_bytes()

    def refuse(specification):
        assert specification == SPECIFICATION
        raise ValueError("another study")

    with pytest.raises(ValueError, match="another study"):
        Log.open(path, refuse)  # without a warning, too
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_a_flipped_bit_loses_at_most_the_record_that_it_hits(path):
    log = Log.open(path)
    offsets = [entry.offset for entry in log.entries]
    log.close()
    whole = path.read_bytes()
    for at in [offsets[1] + k for k in (0, 7, 8, 12, 15, 20, 47, 50, 60)]:
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        path.write_bytes(damaged)
        with pytest.warns(UserWarning, match="1 record damaged"):
            again = Log.open(path)
        left = [entry.task.first for entry in again.entries]
        again.close()
        assert left == [0, 6], at - offsets[1]
        copy = path.with_name(path.name + ".damaged")
        assert copy.read_bytes() == bytes(damaged)
        copy.unlink()
