"""Numba with the settings that it has by itself: what is compiled is kept, and must not depend on who compiled it where.

Numba takes settings from ``NUMBA_*`` in the environment and from ``.numba_config.yaml`` in the working directory, which is
somebody else's as soon as the folder is; they switch compilation off, change the code, or end the import with an error.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any

_CONFIG = "numba.core.config"
_PREFIX = "NUMBA_"
_THREADS = "NUMBA_NUM_THREADS"  # says nothing about code, and cannot be changed once there are threads
# What Numba looks at once, when it makes its first code: of a process that did so under others, nothing is kept
_LASTING = ("CPU_NAME", "CPU_FEATURES", "ENABLE_AVX", "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE")


_imported_here = False
_lasts = True


def may_be_kept() -> bool:
    """Whether what was compiled last is what any process would have made."""
    return _lasts


@contextmanager
def own_settings() -> Iterator[None]:
    """Numba's own settings for as long as the block lasts; for one thread at a time."""
    global _lasts  # noqa: PLW0603
    config = _imported()
    given = {name: value for name, value in vars(config).items() if name.isupper()}
    reload = config.reload_config
    config.reload_config = lambda: None  # which every compilation calls
    try:
        config._env_reloader.process_environ({_THREADS: str(given[_THREADS])})
        _lasts = _imported_here or all(given.get(name) == getattr(config, name, None) for name in _LASTING)
        yield
    finally:
        vars(config).update(given)
        config.reload_config = reload


def _imported() -> Any:
    """Numba's configuration; where this is what imports Numba, without anybody's settings, which it has from then on."""
    global _imported_here  # noqa: PLW0603
    if "numba" in sys.modules:
        return import_module(_CONFIG)
    _imported_here = True
    kept = {name: os.environ.pop(name) for name in list(os.environ) if name.startswith(_PREFIX) and name != _THREADS}
    yaml = sys.modules.get("yaml")
    sys.modules["yaml"] = None  # type: ignore[assignment]
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "A Numba config file is found")
            config: Any = import_module(_CONFIG)
    finally:
        os.environ.update(kept)
        del sys.modules["yaml"]
        if yaml is not None:
            sys.modules["yaml"] = yaml
    with suppress(ImportError):
        config.yaml, config._HAVE_YAML = import_module("yaml"), True
    with suppress(Exception), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        config.reload_config()  # for whoever else uses Numba in this process
    return config
