"""Locks that end with the process that has them: what is not locked was left behind by one that was killed."""

from __future__ import annotations


def lock(handle: int, wait: bool) -> bool:
    """Whether a file or folder is locked for this process now; never where the system or the file system has no such locks."""
    try:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except (ImportError, OSError):
        return False
    return True
