"""The speed floor: the same estimators written by hand in C for one problem."""

from floor.floor import Floor

__all__ = ["Floor"]
