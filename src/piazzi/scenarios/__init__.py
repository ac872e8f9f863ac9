"""Problems as files: the built-in ones and a user's own.  `piazzi.scenarios()` gives the built-in ones with their titles."""

import sys
from types import ModuleType

from piazzi.scenarios.loader import check, load_scenario, names, show, titles
from piazzi.scenarios.scenario import Picture, Recording, Scenario
from piazzi.scenarios.table import Fault, ScenarioError
from piazzi.scenarios.truth import vary

__all__ = [
    "Fault",
    "Picture",
    "Recording",
    "Scenario",
    "ScenarioError",
    "check",
    "load_scenario",
    "names",
    "show",
    "titles",
    "vary",
]


class _Scenarios(ModuleType):
    """The module, which answers when it is called."""

    def __call__(self) -> dict[str, str]:
        """Names of the built-in scenarios, with their titles."""
        return titles()


sys.modules[__name__].__class__ = _Scenarios
