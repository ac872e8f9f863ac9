"""Problems as files: the built-in ones and a user's own."""

from piazzi.scenarios.loader import check, load_scenario, names, show
from piazzi.scenarios.scenario import Picture, Recording, Scenario
from piazzi.scenarios.table import Fault, ScenarioError
from piazzi.scenarios.truth import vary

__all__ = ["Fault", "Picture", "Recording", "Scenario", "ScenarioError", "check", "load_scenario", "names", "show", "vary"]
