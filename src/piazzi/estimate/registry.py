"""Estimators by the names that the command line and studies use: ``ekf``, ``graph``, ``window:100x3``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, cast

from piazzi.estimate.estimator import Estimator
from piazzi.text import nearest
from piazzi.units import duration

GATE, ITERATIONS = 0.999, 5  # where the text gives no number


@dataclass(frozen=True)
class Entry:
    """One kind of estimator: how it is written, what it is, and where its class is."""

    syntax: str
    summary: str
    place: str
    settings: Callable[[str], Mapping[str, Any]]

    def build(self, option: str) -> Estimator:
        """The estimator with these options; raises ValueError for options that it does not have."""
        module, name = self.place.split(":")
        return cast(Estimator, getattr(import_module(module), name)(**self.settings(option)))


def _filter(option: str) -> Mapping[str, Any]:
    """How rows are taken in, and a gate: "gate" or "gate=0.99", in any order, with colons between them."""
    words = [word.partition("=") for word in option.split(":")] if option else []
    settings: dict[str, Any] = {}
    for word, equals, value in words:
        if word != "gate":
            settings["update"] = word + equals + value
            continue
        try:
            settings["gate"] = float(value) if equals else GATE
        except ValueError:
            raise ValueError(f"gate is {value!r}; it must be a probability, such as gate={GATE}") from None
    return settings


def _gated(option: str) -> Mapping[str, Any]:
    """A gate alone: "gate" or "gate=0.99"."""
    settings = _filter(option)
    if "update" in settings:
        raise ValueError("its only option is gate or gate=P")
    return settings


def _iterated(option: str) -> Mapping[str, Any]:
    """How often, then the options of a filter: ``iekf:3:gate``."""
    first, _, rest = option.partition(":")
    if re.fullmatch(r"\d{1,9}", first, re.ASCII):
        return {"iterations": int(first), **_filter(rest)}
    return {"iterations": ITERATIONS, **_filter(option)}


def _graph(option: str) -> Mapping[str, Any]:
    """A start and a loss, in any order: ``graph:window:huber``, ``graph:bank=64``, ``graph:tukey=6``."""
    settings: dict[str, Any] = {}
    for word in option.split(":") if option else ():
        new = _loss(word) or _bank(word) or {"start": word}
        if settings.keys() & new.keys():
            raise ValueError(f"{word!r} is one too many: give one start and one loss")
        settings |= new
    return settings


def _loss(word: str) -> Mapping[str, Any]:
    """The setting that the name of a loss means; none for another word."""
    from piazzi.estimate.losses import LOSSES

    return {"loss": word} if word.partition("=")[0] in LOSSES else {}


def _bank(word: str) -> Mapping[str, Any]:
    """The setting that "bank=MEMBERS" means; none for another word."""
    name, equals, members = word.partition("=")
    if name != "bank" or not equals:
        return {}
    if not re.fullmatch(r"\d{1,9}", members, re.ASCII):
        raise ValueError(f"bank is {members!r}; it must be a number of starts, such as bank=64")
    from piazzi.estimate.bank import Bank

    return {"start": Bank(int(members))}


def _plain(option: str) -> Mapping[str, Any]:
    if option:
        raise ValueError("it has no options")
    return {}


def _passes(option: str) -> Mapping[str, Any]:
    """How often: ``smoother:3``."""
    if option and not re.fullmatch(r"\d{1,9}", option, re.ASCII):
        raise ValueError("its only option is a number of passes, such as smoother:3")
    return {"iterations": int(option)} if option else {}


def _window(option: str) -> Mapping[str, Any]:
    """A lag with iterations, and a loss: ``window:100x3:huber``."""
    size, _, word = option.partition(":")
    if not word and _loss(size):
        size, word = "", size
    loss = _loss(word)
    if word and not loss:
        raise ValueError(f"{word!r} is no loss: write window:LAG:huber, window:LAG:cauchy or window:LAG:tukey")
    return {**_size(size), **loss}


def _size(option: str) -> Mapping[str, Any]:
    """States or a length of time, then how often: ``100``, ``100x3``, ``60s``, ``6h``, ``60sx3``."""
    found = re.fullmatch(r"(?:(\d{1,9})|(\d{1,9}(?:\.\d{1,9})? ?[A-Za-wyz]+))(?:x(\d{1,9}))?", option, re.ASCII)
    if not option:
        return {}
    if not found:
        raise ValueError(
            "write window:LAG or window:LAGxITERATIONS, such as window:100, window:100x3, or a length of time as in window:60s"
        )
    states, length, iterations = found.groups()
    lag = {"lag_seconds": duration(length, "its length")} if length else {"lag": int(states)}
    return lag | ({"iterations": int(iterations)} if iterations else {})


ESTIMATORS: Mapping[str, Entry] = {
    "ekf": Entry(
        "ekf[:joint|:components][:gate[=P]]",
        "extended Kalman filter; gate=P leaves out rows that are worse than a share P of good ones",
        "piazzi.estimate.kalman:ExtendedKalmanFilter",
        _filter,
    ),
    "iekf": Entry(
        "iekf[:ITERATIONS][:gate[=P]]",
        "extended Kalman filter whose updates are iterated",
        "piazzi.estimate.kalman:ExtendedKalmanFilter",
        _iterated,
    ),
    "srekf": Entry(
        "srekf[:gate[=P]]",
        "extended Kalman filter in square-root form",
        "piazzi.estimate.square_root:SquareRootKalmanFilter",
        _gated,
    ),
    "ukf": Entry(
        "ukf[:gate[=P]]",
        "unscented Kalman filter: sigma points instead of Jacobians",
        "piazzi.estimate.unscented:UnscentedKalmanFilter",
        _gated,
    ),
    "smoother": Entry(
        "smoother[:PASSES]",
        "fixed-interval smoother: the extended Kalman filter forward, and once back; further passes along what it found",
        "piazzi.estimate.smoother:Smoother",
        _passes,
    ),
    "batch": Entry(
        "batch",
        "batch least squares over the initial state, without process noise",
        "piazzi.estimate.batch:BatchLeastSquares",
        _plain,
    ),
    "graph": Entry(
        "graph[:ekf|:prior|:window|:bank[=N]|:orbits][:LOSS[=K]]",
        "factor graph over all states, started from one of these; a LOSS (huber, cauchy, tukey) withstands outliers",
        "piazzi.estimate.factor_graph:FactorGraph",
        _graph,
    ),
    "window": Entry(
        "window:LAG[xITERATIONS][:LOSS[=K]]",
        "factor graph over the newest LAG states, or of a length of time as 60s, 6h",
        "piazzi.estimate.sliding_window:SlidingWindow",
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
    name, colon, option = text.strip().partition(":")
    if name not in ESTIMATORS:
        raise ValueError(f"unknown estimator {text!r}{nearest(name, ESTIMATORS)}")
    if colon and not option:
        raise ValueError(f"estimator {text!r}: nothing follows the colon; write {ESTIMATORS[name].syntax}")
    try:
        return ESTIMATORS[name].build(option)
    except ValueError as error:
        raise ValueError(f"estimator {text!r}: {error}") from None


def by_name(estimators: Mapping[str, Estimator] | Sequence[str]) -> Mapping[str, Estimator]:
    """The mapping as it is, or the estimators that a list of names means; raises ValueError for what is neither."""
    found: dict[str, Estimator] = {}
    if isinstance(estimators, Mapping):
        found = dict(estimators)
    elif isinstance(estimators, str):
        raise ValueError(f"estimators is {estimators!r}; it must be a list of names or a mapping")
    else:
        for name in estimators:
            if not isinstance(name, str):
                raise ValueError(f"estimators has {name!r}: give names, or a mapping of names to estimators")
            if name in found:
                raise ValueError(f"estimator {name!r} is named twice")
            found[name] = parse(name)
    if not found:
        raise ValueError("there are no estimators to compare")
    return found
