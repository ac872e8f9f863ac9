"""Names of a package are imported when they are asked for; its `__init__` says where they are, in imports for type checkers."""

from __future__ import annotations

import ast
import sys
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any


class Face(ModuleType):
    """A package whose names come from the imports below its `if TYPE_CHECKING:`, or are modules in it."""

    def __getattr__(self, name: str) -> Any:
        home = None if name.startswith("__") else homes(str(self.__file__)).get(name, self.__name__)
        if home is None or (home == self.__name__ and find_spec(f"{home}.{name}") is None):
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        value = import_module(f"{home}.{name}") if home == self.__name__ else getattr(import_module(home), name)
        self.__dict__[name] = value
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        # A module that was imported is bound in its package: where a function has its name the function is what is meant
        if isinstance(value, ModuleType) and name in self.__dict__.get("__all__", ()):
            value = getattr(value, name, value)
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted(self.__all__)


@cache
def homes(file: str) -> dict[str, str]:
    """Module of every name that the imports for type checkers bring."""
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    imports = (node for part in tree.body if isinstance(part, ast.If) for node in part.body if isinstance(node, ast.ImportFrom))
    return {alias.name: str(node.module) for node in imports for alias in node.names}


def lazy(package: str, face: type[Face] = Face) -> None:
    """Let a package import its names when they are asked for."""
    sys.modules[package].__class__ = face
