"""From tracking of any kind to an orbit: one call makes the problem, solves it, tests it and writes it down."""

from piazzi.determination.determining import determine
from piazzi.determination.guesses import Guess, guess_of
from piazzi.determination.orbit import Orbit
from piazzi.determination.result import Determination
from piazzi.determination.sensing import Measured, measured

__all__ = ["Determination", "Guess", "Measured", "Orbit", "determine", "guess_of", "measured"]
