"""Estimators by the names that the command line and studies use: ``ekf``, ``graph``, ``window:100x3``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, cast

from piazzi.estimate.estimator import Estimator, View
from piazzi.model import nearest


@dataclass(frozen=True)
class Entry:
    """One kind of estimator: how it is written, what it is, where its class is, and which views of the states it gives."""

    syntax: str
    summary: str
    place: str
    views: tuple[View, ...]
    settings: Callable[[str], Mapping[str, Any]]

    def build(self, option: str) -> Estimator:
        """The estimator with these options; raises ValueError for options that it does not have."""
        module, name = self.place.split(":")
        return cast(Estimator, getattr(import_module(module), name)(**self.settings(option)))


def _update(option: str) -> Mapping[str, Any]:
    return {"update": option} if option else {}


def _start(option: str) -> Mapping[str, Any]:
    return {"start": option} if option else {}


def _window(option: str) -> Mapping[str, Any]:
    found = re.fullmatch(r"(\d{1,9})(?:x(\d{1,9}))?", option, re.ASCII)
    if option and not found:
        raise ValueError("write window:LAG or window:LAGxITERATIONS, such as window:100 or window:100x3")
    return {k: int(v) for k, v in zip(("lag", "iterations"), found.groups(), strict=True) if v} if found else {}


ESTIMATORS: Mapping[str, Entry] = {
    "ekf": Entry(
        "ekf[:joint|:components]",
        "extended Kalman filter",
        "piazzi.estimate.kalman:ExtendedKalmanFilter",
        ("realtime",),
        _update,
    ),
    "graph": Entry(
        "graph[:ekf|:prior|:window]",
        "factor graph over all states, started from one of these",
        "piazzi.estimate.factor_graph:FactorGraph",
        ("delayed",),
        _start,
    ),
    "window": Entry(
        "window:LAG[xITERATIONS]",
        "factor graph over the newest LAG states",
        "piazzi.estimate.sliding_window:SlidingWindow",
        ("realtime", "delayed"),
        _window,
    ),
}


def parse(text: str) -> Estimator:
    """The estimator that this text means, such as ``ekf``, ``graph`` or ``window:100x3``.

    Raises
    ------
    ValueError
        For an unknown name (with the nearest one) or options that the estimator does not have.
    """
    name, _, option = text.strip().partition(":")
    if name not in ESTIMATORS:
        raise ValueError(f"unknown estimator {text!r}{nearest(name, ESTIMATORS)}")
    try:
        return ESTIMATORS[name].build(option)
    except ValueError as error:
        raise ValueError(f"estimator {text!r}: {error}") from None


def views_of(estimator: Any) -> tuple[View, ...]:
    """The views that an estimator of this class gives; realtime for one that is not in the table."""
    place = f"{type(estimator).__module__}:{type(estimator).__qualname__}"
    return next((entry.views for entry in ESTIMATORS.values() if entry.place == place), ("realtime",))
