"""Made-up passes of a laser sphere over four stations: what solves them is one model, so that one kernel serves all tests."""

import numpy as np

import piazzi as pz
from piazzi.determination import Guess
from piazzi.determination.determining import prepared
from piazzi.formats import Observations, Segment

EPOCH = pz.Epoch("2016-02-13T12:00:00 UTC")
STATE = np.array([9643000.0, 6000000.0, 4600000.0, -3600.0, 4000.0, 1800.0])  # m, m/s, GCRF: near 12,000 km
SITES = ("7090", "7119", "7825", "7941")
SIGMA = 0.03
EACH = 12  # rows of a pass


def twelve_passes():
    """The setup of the passes, whose values are not measured yet."""
    t = np.concatenate([7200.0 * k + np.arange(EACH) * 120.0 for k in range(12)])
    rows = Observations(
        epoch=EPOCH, t=t, value=np.full(len(t), 7e6), kinds=("range",), kind=np.zeros(len(t), dtype=int),
        participants=(*SITES, "LAGEOS-2"), station=np.repeat(np.arange(12) % 4, EACH), object=len(SITES), sigma=SIGMA, tag=1,
        segments=(Segment("UTC", way="two-way", range_is="half", tag="transmit", wavelength=5.32e-7),),
    )  # fmt: skip
    return prepared(rows, guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations="ilrs")
