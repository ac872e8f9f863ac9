"""Whether a place is ours alone: nobody else can write there, or put something else in its stead.

The rules are those that ssh has for its keys: the place is ours; all that leads to it belongs to us or to root, and others can
write there only where the sticky bit keeps them from what is not theirs.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_MOST_LINKS = 40
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def check_ours(found: os.stat_result, place: Path) -> None:
    """Raise OSError where something is not ours, or others can write to it."""
    if not hasattr(os, "geteuid"):
        return
    if found.st_uid != os.geteuid():
        raise OSError(f"{place} belongs to another user; remove it, or name another place")
    mode = stat.S_IMODE(found.st_mode)
    if mode & _OTHERS_WRITE:  # and what is in it now may be theirs, whatever the mode will be
        raise OSError(f"others can write to {place}: its mode is {mode:o}; remove it, and it is made anew")


def check_way(place: Path) -> None:
    """Raise OSError where another user could put something else in the stead of a folder, be it there already or not.

    Where users are not told apart by numbers (Windows), a folder below the user's own is taken, and no other.
    """
    if not hasattr(os, "geteuid"):
        if not place.resolve().is_relative_to(Path.home().resolve()):
            raise OSError(f"who else can write to {place} cannot be told on this system: it is not in {Path.home()}")
        return
    for step in _way(place):
        try:
            found = os.lstat(step)
        except FileNotFoundError:
            return
        if found.st_uid not in (0, os.geteuid()):
            what = f"{place} belongs" if step == place else f"{place} lies behind {step}, which belongs"
            raise OSError(f"{what} to another user; name another place")
        if stat.S_ISDIR(found.st_mode) and _others_can_replace(found) and step != place:
            mode = stat.S_IMODE(found.st_mode)
            raise OSError(f"others can write to {step}, where {place} lies: its mode is {mode:o}; name another place")


def _way(place: Path) -> Iterator[Path]:
    """Every folder and link that decides what a path leads to, from the root on."""
    at, rest, links = Path(place.anchor), list(place.parts[1:]), 0
    yield at
    while rest:
        part = rest.pop(0)
        if part == os.pardir:
            at = at.parent
            continue
        step = at / part
        yield step
        if not step.is_symlink():
            at = step
            continue
        links += 1
        if links > _MOST_LINKS:
            raise OSError(f"{place}: too many links")
        target = Path(os.readlink(step))
        at, rest = (Path(target.anchor), [*target.parts[1:], *rest]) if target.anchor else (at, [*target.parts, *rest])


def _others_can_replace(found: os.stat_result) -> bool:
    """Whether others can rename what lies in a folder: the sticky bit forbids it, and the group may be the user alone."""
    if found.st_mode & stat.S_ISVTX:
        return False
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not _is_own_group(found.st_gid)


@cache
def _is_own_group(group: int) -> bool:
    """Whether a group is the one of the user's own name that many systems give everybody, with nobody else in it."""
    try:
        import grp
        import pwd

        user, found = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
    except (ImportError, KeyError):
        return False
    return user.pw_gid == group and found.gr_name == user.pw_name and set(found.gr_mem) <= {user.pw_name}
