"""Versions of everything that the bits of a result depend on."""

from __future__ import annotations

from functools import lru_cache

from piazzi.kernels.spec import machine_lanes

_SAME = ("python", "piazzi", "numpy", "llvmlite", "numba", "lanes")


def difference_of(there: dict[str, str], here: dict[str, str]) -> str:
    """What differs between two sets of versions, "" where nothing does."""
    return "; ".join(
        f"{name} {there.get(name, 'none')}, not {here[name]} as here" for name in _SAME if there.get(name) != here[name]
    )


@lru_cache(maxsize=1)
def _fingerprint() -> tuple[tuple[str, str], ...]:
    import hashlib
    import platform
    from importlib.metadata import version
    from pathlib import Path

    root, text = Path(__file__).resolve().parents[1], hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        text.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    own = f"{version('piazzi')} (source {text.hexdigest()[:8]})"
    others = {name: version(name) for name in ("numpy", "llvmlite", "numba")}
    return tuple({"python": platform.python_version(), "piazzi": own, **others}.items())


def fingerprint() -> dict[str, str]:
    """Versions of everything that the bits of a result depend on: the text of Piazzi itself, and the lanes that it works in."""
    return {**dict(_fingerprint()), "lanes": str(machine_lanes())}
