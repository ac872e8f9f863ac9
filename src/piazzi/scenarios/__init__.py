"""Problems as files: the built-in ones and a user's own.  `piazzi.scenarios()` gives the built-in ones with their titles."""

from typing import TYPE_CHECKING

from piazzi.faces import Face, lazy

if TYPE_CHECKING:
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


class _Scenarios(Face):
    """The module, which answers when it is called."""

    def __call__(self) -> dict[str, str]:
        """Names of the built-in scenarios, with their titles."""
        named: dict[str, str] = self.titles()
        return named


lazy(__name__, _Scenarios)
