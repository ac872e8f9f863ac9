"""Problems as files: the built-in ones and a user's own."""

from piazzi.scenarios.faults import Fault, ScenarioError
from piazzi.scenarios.loader import check, load_scenario, names, show
from piazzi.scenarios.options import vary
from piazzi.scenarios.scenario import Picture, Scenario

__all__ = ["Fault", "Picture", "Scenario", "ScenarioError", "check", "load_scenario", "names", "show", "vary"]
