"""A model with its numbers.  Every check of a problem's inputs is made here; kernels trust them afterwards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isfinite
from typing import Any

import numpy as np

from piazzi.drawn import Shown, later
from piazzi.kernels import Integrator, Kepler, KernelSpec, RungeKutta8
from piazzi.kernels.bundle import Belief, Given
from piazzi.kernels.spec import outside_fragments
from piazzi.model import Model
from piazzi.problem import checked, evaluation, layout, manoeuvres, outside
from piazzi.problem.arcs import Arc, Steps, arc
from piazzi.problem.checks import Array, check_span, finite_vector, lock, numeric
from piazzi.problem.constants import with_station_constants
from piazzi.problem.epochs import check_near, epoch_given
from piazzi.problem.parts import Gaussian, Manoeuvre, Station, Truth
from piazzi.text import listed, nearest

_OF_PRIOR = ("mean", "covariance", "prior_bundle", "_steps")  # what is worked out of it


@dataclass(frozen=True, eq=False)
class Problem(Shown):
    """Everything an estimator needs besides the measurements.

    Parameters
    ----------
    model : Model
    prior : Gaussian
        Belief about the states (not the estimated constants) at `prior_time`.
    process_noise : ProcessNoise, or a matrix (a density per second, integrated), or None for none
    stations : sequence of Station
    parameters : mapping of name to number
        An estimated or considered constant takes a `Gaussian`, ``Gaussian(mean, variance)``.  So may a number of a station.
    integrator : Integrator
        Default `RungeKutta4()`, ten substeps per interval; `Discrete()` for a model that is a step.
    prior_time : float, optional
        Seconds; default the first epoch of the tracking, whatever that is.  A scenario's is the start of its ``[times]``.
    truth : Truth, optional
        What simulation does differently.
    name : str
    manoeuvres : sequence of Manoeuvre
        Sudden changes of the state, applied by every estimator and in simulation.
    epoch : Epoch, or what one is made of, optional
        The instant of time zero: all times are seconds of TT past it, and stay within 1e8 s.
    functions : mapping of name to function from outside
        The data of the model's functions, such as ``{"field": earth.Gravity("EGM2008", degree=20)}``.

    Raises
    ------
    ValueError
        For wrong shapes, asymmetric or indefinite covariances, values that are not finite, missing or unknown names.
    """

    model: Model
    prior: Gaussian
    process_noise: Any = None
    stations: Sequence[Station] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    integrator: Integrator | None = None
    prior_time: float | None = None
    truth: Truth | None = None
    name: str = ""
    manoeuvres: Sequence[Manoeuvre] = ()
    epoch: Any = None
    functions: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        put = object.__setattr__
        given = [self.stations] if isinstance(self.stations, Station) else list(self.stations)
        model, stations, parameters = with_station_constants(self.model, given, self.parameters)
        put(self, "model", model)
        put(self, "functions", outside.checked_functions(self.functions, model))
        put(self, "process_noise", checked.process_noise(self.process_noise, model))
        put(self, "stations", checked.stations(stations, model))
        put(self, "parameters", checked.parameters(parameters, model))
        put(self, "manoeuvres", manoeuvres.checked(self.manoeuvres, self.model))
        put(self, "integrator", checked.integrator(self.integrator, model))
        if self.prior_time is not None and not isfinite(self.prior_time):
            raise ValueError(f"prior_time is {self.prior_time}; it must be finite")
        put(self, "epoch", epoch_given(self.epoch))
        check_near(self.prior_time or 0.0, self.epoch, "prior_time")
        check_near([m.time for m in self.manoeuvres], self.epoch, "the time of a manoeuvre,")
        put(self, "prior", checked.prior(self.prior, model))
        self._check_regular()
        self._lay_out()
        if isinstance(self.integrator, Kepler):
            from piazzi.problem.two_body import check_two_body

            check_two_body(self.model, self.integrator, self._values())

    def __getstate__(self) -> dict[str, Any]:
        """Without the specifications of kernels, which this process shares, and without bundles, which have addresses."""
        return {name: value for name, value in self.__dict__.items() if name not in ("specs", "_told", "prior_bundle")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Nothing can be written into a copy either; the truth is the user's own, as it was given."""
        self.__dict__.update(state)
        lock({name: value for name, value in state.items() if name not in ("model", "truth", "functions")})

    # ---- checks --------------------------------------------------------------------------------------------------

    def _check_regular(self) -> None:
        """Refuse a prior mean where an equation has no value, or a function of the user's own has wrong derivatives."""
        given = self.model, self.stations, self._values(), self.prior_time or 0.0, self.functions
        where = evaluation.singular_equation(*given)
        if where:
            raise ValueError(where)
        evaluation.check_own_functions(*given)

    def _values(self) -> dict[str, float]:
        """Values of states and parameters at the prior mean, by name."""
        return dict(zip(self.model.names, self.mean, strict=True)) | dict(zip(self.model.given, self.given, strict=False))

    # ---- what kernels are given ----------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        """Make the arrays now, so that no run has to."""
        for name in (
            "mean",
            "covariance",
            "given",
            "narrowest",
            "considered",
            "is_correlated",
            "noise_fragment",
            "specs",
            "approximated",
        ):
            getattr(self, name)
        for name in ("sensor", "noise", "correlated", "numbers"):
            getattr(self, f"station_{name}")

    def to_toml(self, path: Any = None, times: Any = None) -> str:
        """The whole problem as a scenario, every default spelled out, which every command and `load` take; returns the text.

        Parameters
        ----------
        path : where it is written too, whole or not at all
        times : (K,) s, when simulation of it measures; default an hour from the prior, every minute

        Raises
        ------
        ValueError
            For a problem that a file cannot hold, as one with functions that are known in Python only.
        OSError
            Where nothing can be written there.
        """
        if path is None:
            return str(later("io.scenario_text", "scenario_text")(self, times))
        return str(later("io.scenario_text", "write_scenario")(path, self, times))

    def __repr__(self) -> str:
        """In short: what is estimated, by whom it is seen, and when time zero is."""
        named = f"{self.name!r}: " if self.name else ""
        seen = f", seen by {listed(s.name for s in self.stations)}" if self.stations else ""
        since = "" if self.epoch is None else f", t from {self.epoch}"
        return f"<Problem {named}{listed(self.model.names, 12)}{seen}{since}>"

    @cached_property
    def mean(self) -> Array:
        """Prior mean of everything estimated, (n,)."""
        return layout.mean(self.model, self.prior, self.parameters)

    @cached_property
    def covariance(self) -> Array:
        """Prior covariance of everything estimated, (n, n)."""
        return layout.covariance(self.model, self.prior, self.parameters)

    @cached_property
    def given(self) -> Array:
        """Values of the parameters that are not estimated, at least one number long."""
        return layout.given(self.model, self.parameters)

    @property
    def given_bundle(self) -> Given:
        """What kernels are told of the model; data of functions from outside reach as far as `cover` was asked for."""
        return self._told.bundle

    def cover(self, first: float, last: float) -> bool:
        """Have data of the functions from outside for these times (s); True where what kernels are told has changed.

        Raises
        ------
        ValueError
            Where a function has no values at some of them.
        """
        return self._told.cover(first, last)

    def given_over(self, first: float, last: float) -> Given:
        """What kernels are told of the model, with data for these times (s); raises ValueError as `cover` does."""
        self._told.cover(first, last)
        return self._told.bundle

    @cached_property
    def _told(self) -> outside.Told:
        recipes = outside.recipes_of(self.model, self.functions, [s.place for s in self.stations])
        spans = outside.spans_of(self.model, self.functions) if recipes else ()
        return outside.Told(self.given, manoeuvres.packed(self.manoeuvres, self.model), recipes, spans, self.prior_time or 0.0)

    @property
    def checksums(self) -> dict[str, str]:
        """What the data of its functions from outside, and of its stations' places, are told apart by."""
        places = {f"station {s.name}": s.place for s in self.stations if s.place is not None}
        return {name: recipe.checksum for name, recipe in {**self.functions, **places}.items()}

    @cached_property
    def approximated(self) -> tuple[str, ...]:
        """Names of the functions from outside whose derivatives are not quite those of their values."""
        return tuple(name for name, recipe in self.functions.items() if outside.exact(recipe) is not recipe)

    def with_exact_derivatives(self) -> Problem:
        """The problem with the derivatives of its functions' values, for which nothing is compiled; else itself."""
        if not self.approximated:
            return self
        return self.with_data({name: outside.exact(recipe) for name, recipe in self.functions.items()})

    def with_data(self, functions: Mapping[str, Any]) -> Problem:
        """The same with other data of some of its functions: what else it is made of was checked when it was made."""
        found = object.__new__(Problem)
        found.__dict__.update({name: value for name, value in self.__dict__.items() if name not in ("_told", "approximated")})
        found.__dict__["functions"] = outside.checked_functions({**self.functions, **functions}, self.model)
        return found

    def with_prior(self, prior: Gaussian, prior_time: float | None) -> Problem:
        """The same with another belief in its states: what else it is made of was checked when it was made.

        Whether equations have values at the new mean is not asked: it is for states of an orbit that was followed to there.
        Tables of functions are shared, and widened for both.
        """
        if prior_time is not None and not isfinite(prior_time):
            raise ValueError(f"prior_time is {prior_time}; it must be finite")
        check_near(prior_time or 0.0, self.epoch, "prior_time")
        found = object.__new__(Problem)
        gone = _OF_PRIOR if prior_time == self.prior_time else (*_OF_PRIOR, "_told")
        found.__dict__.update({name: value for name, value in self.__dict__.items() if name not in gone})
        found.__dict__.update(prior=checked.prior(prior, self.model), prior_time=prior_time)
        found._lay_out()
        return found

    @cached_property
    def prior_bundle(self) -> Belief:
        """The prior of everything estimated, for kernels, which do not write to it."""
        return Belief(mean=self.mean, covariance=self.covariance)

    @cached_property
    def considered(self) -> tuple[str, ...]:
        """Names of the parameters that are considered and uncertain."""
        names = (p.name for p in self.model.parameters if p.role == "considered")
        return tuple(n for n in names if self.parameters[n].covariance[0, 0] > 0)

    @cached_property
    def narrowest(self) -> int:
        """Components of the smallest sensor of any station, 0 where there is no station."""
        return min((len(s.noise) for s in self.stations), default=0)

    @cached_property
    def station_sensor(self) -> Array:
        """Index of each station's sensor, (S,)."""
        return layout.station_sensor(self.stations, self.model)

    @cached_property
    def station_noise(self) -> Array:
        """R of each station, (S, M, M), unit variance where a sensor has fewer components."""
        return layout.station_noise(self.stations, self.model)

    @cached_property
    def station_numbers(self) -> Array:
        """Each station's own numbers in alphabetical order, (S, widest)."""
        return layout.station_numbers(self.stations, self.model)

    @cached_property
    def station_correlated(self) -> Array:
        """For each station, 1 where its R is not diagonal, (S,)."""
        return layout.station_correlated(self.stations)

    @cached_property
    def station_limits(self) -> tuple[tuple[float, ...], ...]:
        """For each station and component, the largest measurement that a number holds more exactly than its noise."""
        return layout.station_limits(self.station_noise)

    @cached_property
    def least_limit(self) -> float:
        """The smallest of `station_limits`, infinite where there is no station."""
        return min((limit for station in self.station_limits for limit in station), default=inf)

    @cached_property
    def least_noise(self) -> float:
        """The smallest variance in `station_noise`, infinite where there is no station."""
        return float(np.diagonal(self.station_noise, axis1=1, axis2=2).min(initial=inf))

    @cached_property
    def is_correlated(self) -> bool:
        """Whether the R of any station is not diagonal."""
        return bool(self.station_correlated.any())

    def spec(self, *fragments: str, lanes: int = 1) -> KernelSpec:
        """The compiled module with these fragments, for this model, integrator, kind of noise, and manoeuvres or none."""
        assert self.integrator is not None
        key = (fragments, lanes)
        spec = self.specs.get(key)
        if spec is None:
            about = {"manoeuvres": bool(self.manoeuvres), "axes": self.process_noise.axes}
            together = self.moves_in_lanes and lanes > 1
            parts = outside_fragments(self.model) + evaluation.fragments_of(
                self.model, fragments, self.integrator, **about, noise_varies=self.noise_varies, in_lanes=together
            )
            apart = evaluation.apart_of(self.model, fragments, self.integrator, **about)
            spec = self.specs[key] = KernelSpec(self.model, self.integrator.scheme, parts, lanes, apart)
        return spec

    @cached_property
    def specs(self) -> dict[tuple[Any, ...], KernelSpec]:
        """Specifications of kernels so far, shared with all problems for which the choice of fragments comes out the same.

        By fragments and lanes, and by what else a reader that is in a hurry finds its own again.
        """
        integrator, events = self.integrator, bool(self.manoeuvres)
        assert integrator is not None
        traits = self.model, type(integrator), integrator.scheme, events, self.process_noise.axes, self.noise_varies
        return evaluation.shared_specs(traits)

    @cached_property
    def noise_fragment(self) -> str:
        return "noise_integral" if self._integrated else "noise_scaled"

    @cached_property
    def _integrated(self) -> bool:
        """Whether noise is integrated along each step: where there is none, there is nothing to integrate."""
        return self.process_noise.is_integral and bool(self.process_noise.covariance.any())

    @cached_property
    def noise_varies(self) -> bool:
        """Whether the noise of an interval depends on the states, so that it is not a multiple of one matrix."""
        moved = self.process_noise.axes != "states" and bool(self.process_noise.covariance.any())
        return self._integrated or moved or any(m.covariance.any() for m in self.manoeuvres)

    @property
    def is_noise_free(self) -> bool:
        """Whether the motion is determined by its first state: no process noise, and manoeuvres without errors."""
        return not (self.process_noise.covariance.any() or any(m.covariance.any() for m in self.manoeuvres))

    def prior_start(self, times: Array) -> float:
        """Time of the prior of a run over these epochs, in seconds."""
        return float(times[0]) if self.prior_time is None else float(self.prior_time)

    @property
    def moves_in_lanes(self) -> bool:
        """Whether several of its states can be carried over an interval together: the same operations for each of them."""
        assert self.integrator is not None
        return self.integrator.in_lanes and not self.manoeuvres

    @property
    def runs_in_ensemble(self) -> bool:
        """Whether whole runs can advance together: where states can, with process noise that does not depend on them."""
        on_sky = any(sensor.on_sky for sensor in self.model.sensors)  # their noise depends on the state
        return self.moves_in_lanes and not self.noise_varies and not on_sky

    def intervals(self, times: Array) -> tuple[float, Array, Array]:
        """Time of the prior, and for each epoch the substeps and the noise scale of the interval that ends there."""
        assert self.integrator is not None
        start = self.prior_start(times)
        if start > times[0]:
            raise ValueError(
                f"the prior is at {start:g} s, after the first measurement at {times[0]:g} s: with_prior_at propagates it back"
            )
        check_span(start, times[0], "the first measurement")
        check_near(times[[0, -1]], self.epoch, "time")
        if self.manoeuvres:
            manoeuvres.check_after(self.manoeuvres, start)
        dt = np.empty_like(times)
        dt[0] = times[0] - start
        np.subtract(times[1:], times[:-1], out=dt[1:])
        return start, self.counts(dt, start, float(times[-1])), self.process_noise.scale(dt)

    def counts(self, intervals: Array, start: float, end: float, first: Array | None = None) -> Array:
        """Substeps in each interval of that many seconds, of a run over this span of times; see `steps`."""
        integrator = self.integrator
        assert integrator is not None
        if integrator.needs_times:
            integrator = RungeKutta8(max_step=self.steps(start, end, first).one)
        return integrator.counts(intervals)

    def steps(self, start: float, end: float, first: Array | None = None) -> Steps:
        """The longest steps over a span of times, from a state at its start, the prior mean where none is given."""
        from piazzi.problem.stepping import chosen_steps

        if first is not None:
            return chosen_steps(self, first, start, end)
        if (start, end) not in self._steps:
            self._steps[start, end] = chosen_steps(self, self.mean, start, end)
        return self._steps[start, end]

    @cached_property
    def _steps(self) -> dict[tuple[float, float], Steps]:
        return {}

    def max_step(self, times: Array) -> float | None:
        """Longest step, in seconds, of a run over these times; None where the integrator says it by other means."""
        assert self.integrator is not None
        return (
            self.steps(self.prior_start(times), float(times[-1])).one
            if self.integrator.needs_times
            else self.integrator.max_step
        )

    def with_steps(self, times: Any) -> Problem:
        """The problem with the steps that its tolerance asks for over these times as its `max_step`; else itself."""
        assert self.integrator is not None
        if not self.integrator.needs_times:
            return self
        at = numeric(times, "times").reshape(-1)
        return replace(self, integrator=RungeKutta8(max_step=self.max_step(at)))

    def arc(self, times: Any, first: Any = None, derivative: bool = True) -> Arc:
        """States x_k (K, n) of one orbit at increasing times, and its transition matrices Phi(k, k - 1), (K - 1, n, n).

        Parameters
        ----------
        times : (K,), s
        first : (n,), optional
            The state at the first of the times, after any manoeuvre there; default the prior mean.
        derivative : bool
            Whether the transition matrices are wanted; without them none are returned, (0, n, n), and none computed.

        Raises
        ------
        ValueError
            For times that do not increase, or a state of the wrong shape.
        """
        at = np.ascontiguousarray(numeric(times, "times").reshape(-1))
        if not at.size or not np.isfinite(at).all() or not (at[1:] > at[:-1]).all():
            raise ValueError("the times of an arc must be finite and increase, and there must be one")
        x = self.mean if first is None else finite_vector(first, self.model.n, "first state", self.model.names)
        return arc(self, at, x, self.steps(float(at[0]), float(at[-1]), None if first is None else x), derivative)

    # ---- the model's functions, for users ------------------------------------------------------------------------

    def dynamics(self, x: Any, t: Any = 0.0) -> Array:
        """dx/dt at one state (n,) or many (K, n), same shape."""
        return evaluation.rates(self.spec("transition", "rates"), "evaluate_dynamics", self._given_at(t), x, t)

    def dynamics_jacobian(self, x: Any, t: Any = 0.0) -> Array:
        """F = df/dx at one state (n, n) or many (K, n, n)."""
        return evaluation.rates(self.spec("transition", "rates"), "evaluate_dynamics_jacobian", self._given_at(t), x, t)

    def step(self, x: Any, dt: float, t: Any = 0.0) -> tuple[Array, Array]:
        """The state `dt` seconds later and the derivative of that step, shapes (n,), (n, n) or (K, n), (K, n, n)."""
        return evaluation.step(self.spec("transition", "functions"), self.counts, self._given_at(t, dt), x, dt, t)

    def measure(self, station: str, x: Any, t: Any = 0.0) -> Array:
        """Noiseless measurement h of a station, (m,) or (K, m)."""
        return evaluation.measure(*self._measured(station), self._given_at(t), x, t)

    def measurement_jacobian(self, station: str, x: Any, t: Any = 0.0) -> Array:
        """H = dh/dx of a station, (m, n) or (K, m, n)."""
        return evaluation.measurement_jacobian(*self._measured(station), self._given_at(t), x, t)

    def _given_at(self, t: Any, dt: float = 0.0) -> Given:
        times = numeric(t, "time").reshape(-1)
        if not times.size or not np.isfinite(times).all() or not isfinite(dt):
            return self.given_bundle  # whoever reads the times says what is wrong with them
        return self.given_over(float(times.min() + min(dt, 0.0)), float(times.max() + max(dt, 0.0)))

    def _measured(self, station: str) -> tuple[KernelSpec, int, Array, int]:
        """Compiled module, index of the sensor, own numbers and number of components of a station."""
        s = self.station_index(station)
        spec = self.spec("transition", "functions")
        return spec, int(self.station_sensor[s]), self.station_numbers[s], len(self.stations[s].noise)

    def station_index(self, name: str) -> int:
        """Position of a station; raises ValueError with the nearest name."""
        names = [s.name for s in self.stations]
        if name not in names:
            raise ValueError(f"unknown station {name!r}{nearest(name, names)}")
        return names.index(name)
