"""Orbits, stations and what a signal does by iteration along a trajectory, without the package's sensors."""

import numpy as np

import piazzi as pz
from piazzi import earth

C = 299792458.0
EPOCH = pz.Epoch("2016-02-13T16:00:00 UTC")
FORCES = earth.Forces(degree=4)
T = 777.0
YARRAGADEE = earth.Station.geodetic("Yarragadee", np.radians(-29.05), np.radians(115.35), 244.0)
HERSTMONCEUX = earth.Station.geodetic("Herstmonceux", np.radians(50.87), np.radians(0.34), 75.0)


def orbit(kind):
    """A state above Yarragadee at T."""
    radius = {"LEO": 6.9e6, "GEO": 4.2164e7, "Moon": 3.844e8}[kind]
    q = np.array(earth.Place(YARRAGADEE, EPOCH).value(T))
    up = q[:3] / np.linalg.norm(q[:3])
    side = np.cross([0.1, 0.3, 1.0], up)
    side /= np.linalg.norm(side)
    r = radius * (np.cos(0.05) * up + np.sin(0.05) * side)
    speed = np.sqrt(3.986004418e14 / radius)
    along = np.cross(np.cross(r, [0.3, 0.2, 1.0]), r)
    return np.concatenate([r, 0.9 * speed * along / np.linalg.norm(along)])


def problem(*given, station=YARRAGADEE, x=None, parameters=None, numbers=None, forces=FORCES, **changes):
    """A problem with these sensors at one station."""
    model = forces.model(given)
    functions = forces.functions(EPOCH)
    for sensor in given:
        functions |= sensor.functions(EPOCH)
    stations = [
        pz.Station(**(sensor.at(station, EPOCH, 1.0, name=sensor.name, **(numbers or {})) | changes)) for sensor in given
    ]
    prior = pz.Gaussian(orbit("LEO") if x is None else x, [1.0] * 6)
    values = {**forces.values, **(parameters or {})}
    return pz.Problem(
        model, prior, None, stations, values, pz.RungeKutta8(30), prior_time=0.0, functions=functions, epoch=EPOCH
    )


class Trajectory:
    """An orbit at any time near T, by small Runge-Kutta steps of the equations of motion."""

    def __init__(self, p, x, t=T, step=5.0):
        self.f, self.x, self.t, self.step = p.dynamics, np.array(x), t, step

    def __call__(self, t):
        steps = max(int(np.ceil(abs(t - self.t) / self.step)), 1)
        h, x = (t - self.t) / steps, self.x
        for k in range(steps):
            at = self.t + k * h
            k1 = self.f(x, at)
            k2 = self.f(x + h / 2 * k1, at + h / 2)
            k3 = self.f(x + h / 2 * k2, at + h / 2)
            k4 = self.f(x + h * k3, at + h)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return x


class Site:
    """Position and velocity of a station at any time."""

    def __init__(self, station=YARRAGADEE):
        self.place = earth.Place(station, EPOCH)

    def __call__(self, t):
        return np.array(self.place.value(t))


def light_time(there, here, sign):
    """The light time between `there(sign*tau)` and a place, by repetition; and the state there."""
    tau = 0.0
    for _ in range(8):
        far = there(sign * tau)
        tau = np.linalg.norm(far[:3] - here[:3]) / C
    return tau, far


def legs(path, tag, orbit, down_site, up_site, t=T):
    """Down and up light time, and states: receiver, satellite, transmitter, at their events."""
    if tag == "bounce" or (path == "one-way" and tag == "transmission"):
        sat = orbit(t)
        down, rec = light_time(lambda d: down_site(t + d), sat, +1)
        up, tra = light_time(lambda d: up_site(t + d), sat, -1)
    elif tag == "reception":
        rec = down_site(t)
        down, sat = light_time(lambda d: orbit(t + d), rec, -1)
        up, tra = light_time(lambda d: up_site(t - down + d), sat, -1)
    else:
        tra = up_site(t)
        up, sat = light_time(lambda d: orbit(t + d), tra, +1)
        down, rec = light_time(lambda d: down_site(t + up + d), sat, +1)
    return down, up, rec, sat, tra


def slopes(h, x):
    """Derivative of h by the six states, by central differences of two widths."""
    steps = np.array([200.0] * 3 + [0.2] * 3) * max(1.0, np.linalg.norm(x[:3]) / 2e7)
    columns = []
    for j in range(6):
        d = np.zeros(6)
        d[j] = steps[j]
        near, far = ((h(x + k * d) - h(x - k * d)) / (2 * k * steps[j]) for k in (1, 2))
        columns.append((4 * near - far) / 3)
    return np.stack(columns, -1)
