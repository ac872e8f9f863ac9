"""Files appear whole or not at all."""

import os
import stat

import pytest

from piazzi.io.atomic import atomic_path, check_writable, sweep


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


def test_what_killed_writers_left_is_swept(tmp_path):
    for name in (".s-abcd_123.nc", ".s-abcd_123.csv", ".t-abcd_123.nc", ".s-short.nc", "s.nc"):
        (tmp_path / name).write_text("x")
    sweep(tmp_path / "s.nc")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([".s-abcd_123.csv", ".t-abcd_123.nc", ".s-short.nc", "s.nc"])


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
