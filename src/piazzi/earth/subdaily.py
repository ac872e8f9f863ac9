"""What moves UT1 and the pole within the day: tides of the oceans, and the pull of Moon and Sun on the Earth's equator.

Daily values of the IERS are free of both: they are added after interpolation (IERS Conventions 2010, 5.5.1 and ch. 8).

* Oceans: the 71 diurnal and semidiurnal lines of the tidal potential (Cartwright, Tayler and Edden), each weighed by three
  orthotides, smooth functions of its frequency, whose weights fit the eight lines of Ray, Steinberg, Chao and Cartwright 1994,
  Science 264, 830-832 (IERS routines CNMTX and ORTHO_EOP).  Up to 1 mas in the pole and 0.1 ms in UT1.
* Libration: tables 5.1a (its ten diurnal lines; the slow ones are in daily values already) and 5.1b (PMSDNUT2, UTLIBR).
  Up to 0.05 mas and 4 us.

Orthotides are made of the potential at fixed delays, so that all of it is a sum of harmonics: real parts of C exp(i angle),
with exact rates.  Angles turn with the Earth and are taken at UT1; at TT instead, 70 s later, it would differ by 1 percent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.eop import ARCSEC, tables
from piazzi.earth.scales import Orientation, Pole
from piazzi.text import brief

_EPOCH = 37076.5  # MJD that phases of the potential are for
_DELAY = 2.0  # days between the values of the potential that orthotides are made of
# Doodson's number, amplitude, phase (rad) and frequency (rad per day)
_POTENTIAL = np.array([
    [117.655, -1.94, 9.0899831, 5.18688050], [125.745, -1.25, 8.8234208, 5.38346657],
    [125.755, -6.64, 12.1189598, 5.38439079], [127.545, -1.51, 1.4425700, 5.41398343],
    [127.555, -8.02, 4.7381090, 5.41490765], [135.645, -9.47, 4.4715466, 5.61149372],
    [135.655, -50.20, 7.7670857, 5.61241794], [137.445, -1.80, -2.9093042, 5.64201057],
    [137.455, -9.54, 0.3862349, 5.64293479], [145.535, 1.52, -3.1758666, 5.83859664],
    [145.545, -49.45, 0.1196725, 5.83952086], [145.555, -262.21, 3.4152116, 5.84044508],
    [145.755, 1.70, 12.8946194, 5.84433381], [147.555, 3.43, 5.5137686, 5.87485066],
    [153.655, 1.94, 6.4441883, 6.03795537], [155.445, 1.37, -4.2322016, 6.06754801],
    [155.455, 7.41, -0.9366625, 6.06847223], [155.655, 20.62, 8.5427453, 6.07236095],
    [155.665, 4.14, 11.8382843, 6.07328517], [157.455, 3.94, 1.1618945, 6.10287781],
    [162.556, -7.14, 5.9693878, 6.24878055], [163.545, 1.37, -1.2032249, 6.26505830],
    [163.555, -122.03, 2.0923141, 6.26598252], [164.554, 1.02, -1.7847596, 6.28318449],
    [164.556, 2.89, 8.0679449, 6.28318613], [165.545, -7.30, 0.8953321, 6.29946388],
    [165.555, 368.78, 4.1908712, 6.30038810], [165.565, 50.01, 7.4864102, 6.30131232],
    [165.575, -1.08, 10.7819493, 6.30223654], [166.554, 2.93, 0.3137975, 6.31759007],
    [167.555, 5.25, 6.2894282, 6.33479368], [173.655, 3.95, 7.2198478, 6.49789839],
    [175.455, 20.62, -0.1610030, 6.52841524], [175.465, 4.09, 3.1345361, 6.52933946],
    [183.555, 3.42, 2.8679737, 6.72592553], [185.355, 1.69, -4.5128771, 6.75644239],
    [185.555, 11.29, 4.9665307, 6.76033111], [185.565, 7.23, 8.2620698, 6.76125533],
    [185.575, 1.51, 11.5576089, 6.76217955], [195.455, 2.16, 0.6146566, 6.98835826],
    [195.465, 1.38, 3.9101957, 6.98928248], [225.855, 1.80, 20.6617051, 11.45675174],
    [227.655, 4.67, 13.2808543, 11.48726860], [235.755, 16.01, 16.3098310, 11.68477889],
    [237.555, 19.32, 8.9289802, 11.71529575], [238.554, 1.30, 5.0519065, 11.73249771],
    [244.656, -1.02, 15.8350306, 11.89560406], [245.645, -4.51, 8.6624178, 11.91188181],
    [245.655, 120.99, 11.9579569, 11.91280603], [246.654, 1.13, 8.0808832, 11.93000800],
    [247.455, 22.98, 4.5771061, 11.94332289], [248.454, 1.06, 0.7000324, 11.96052486],
    [253.755, -1.90, 14.9869335, 12.11031632], [254.556, -2.18, 11.4831564, 12.12363121],
    [255.545, -23.58, 4.3105437, 12.13990896], [255.555, 631.92, 7.6060827, 12.14083318],
    [256.554, 1.92, 3.7290090, 12.15803515], [263.655, -4.66, 10.6350594, 12.33834347],
    [265.455, -17.86, 3.2542086, 12.36886033], [265.655, 4.47, 12.7336164, 12.37274905],
    [265.665, 1.97, 16.0291555, 12.37367327], [272.556, 17.20, 10.1602590, 12.54916865],
    [273.555, 294.00, 6.2831853, 12.56637061], [274.554, -2.46, 2.4061116, 12.58357258],
    [275.545, -1.02, 5.0862033, 12.59985198], [275.555, 79.96, 8.3817423, 12.60077620],
    [275.565, 23.83, 11.6772814, 12.60170041], [275.575, 2.59, 14.9728205, 12.60262463],
    [285.455, 4.47, 4.0298682, 12.82880334], [285.465, 1.95, 7.3254073, 12.82972756],
    [295.555, 1.17, 9.1574019, 13.06071921],
])  # fmt: skip
_ORTHOTIDES = np.array([  # of the diurnal lines, of the semidiurnal ones
    [0.0298, 0.1408, 0.0805, 0.6002, 0.3025, 0.1517],
    [0.0200, 0.0905, 0.0638, 0.3476, 0.1645, 0.0923],
])  # fmt: skip
_WEIGHTS = np.array([  # of x, y (uas) and UT1 (us): pairs in and out of phase, three for diurnal lines and three for the others
    [-6.77832, -14.86323, 0.47884, -1.45303, 0.16406, 0.42030, 0.09398, 25.73054, -4.77974, 0.28080, 1.94539, -0.73089],
    [14.86283, -6.77846, 1.45234, 0.47888, -0.42056, 0.16469, 15.30276, -4.30615, 0.07564, 2.28321, -0.45717, -1.62010],
    [-1.76335, 1.03364, -0.27553, 0.34569, -0.12343, -0.10146, -0.47119, 1.28997, -0.19336, 0.02724, 0.08955, 0.04726],
])  # fmt: skip
# multiples of GMST + pi, l, l', F, D and the node; sine and cosine
_OF_POLE = np.array([  # of x, then of y, uas
    [1, -1, 0, -2, 0, -1, -0.4, 0.3, -0.3, -0.4], [1, -1, 0, -2, 0, -2, -2.3, 1.3, -1.3, -2.3],
    [1, 1, 0, -2, -2, -2, -0.4, 0.3, -0.3, -0.4], [1, 0, 0, -2, 0, -1, -2.1, 1.2, -1.2, -2.1],
    [1, 0, 0, -2, 0, -2, -11.4, 6.5, -6.5, -11.4], [1, -1, 0, 0, 0, 0, 0.8, -0.5, 0.5, 0.8],
    [1, 0, 0, -2, 2, -2, -4.8, 2.7, -2.7, -4.8], [1, 0, 0, 0, 0, 0, 14.3, -8.2, 8.2, 14.3],
    [1, 0, 0, 0, 0, -1, 1.9, -1.1, 1.1, 1.9], [1, 1, 0, 0, 0, 0, 0.8, -0.4, 0.4, 0.8],
])  # fmt: skip
_OF_UT1 = np.array([  # us
    [2, -2, 0, -2, 0, -2, 0.05, -0.03], [2, 0, 0, -2, -2, -2, 0.06, -0.03], [2, -1, 0, -2, 0, -2, 0.35, -0.20],
    [2, 1, 0, -2, -2, -2, 0.07, -0.04], [2, 0, 0, -2, 0, -1, -0.07, 0.04], [2, 0, 0, -2, 0, -2, 1.75, -1.01],
    [2, 1, 0, -2, 0, -2, -0.05, 0.03], [2, 0, -1, -2, 2, -2, 0.04, -0.03], [2, 0, 0, -2, 2, -2, 0.76, -0.44],
    [2, 0, 0, 0, 0, 0, 0.21, -0.12], [2, 0, 0, 0, 0, -1, 0.06, -0.04],
])  # fmt: skip
_GMST_RATE = 2.0 * np.pi * 1.002737909350795  # rad per day of UT1
_ARGUMENT_RATES = (
    np.array([1717915923.2178, 129596581.0481, 1739527262.8478, 1602961601.2090, -6962890.2665]) * ARCSEC / 36525.0
)
_UNITS = np.array([1e-6 * ARCSEC, 1e-6 * ARCSEC, 1e-6])  # radians and seconds


@dataclass(frozen=True)
class SubdailyEOP:
    """Orientation of the Earth with the tides of UT1 and of the pole within the day, and its libration.

    Parameters
    ----------
    eop : what they are added to: `EOP` or `EOPTable`; default the tables of the IERS

    Examples
    --------
    >>> from piazzi import earth
    >>> epoch = earth.Epoch("2016-02-13T16:00:00 UTC")
    >>> turn = earth.rotation("GCRF", "ITRF", epoch, earth.SubdailyEOP())
    """

    eop: Orientation | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        if isinstance(self.eop, SubdailyEOP):
            raise ValueError("eop has the tides within the day already; they are added once")

    @property
    def daily(self) -> Orientation:
        """What it is without them."""
        return tables() if self.eop is None else self.eop

    def ut1_tai(self, whole: Array, fraction: Array) -> Array:
        """UT1 - TAI in seconds, (K,)."""
        daily = self.daily.ut1_tai(whole, fraction)
        return np.asarray(daily + subdaily(_mjd(whole, fraction, daily))[0][..., 2])

    def ut1_rate(self, whole: Array, fraction: Array) -> Array:
        """Seconds of UT1 - TAI per second, (K,)."""
        return np.asarray(self.daily.ut1_rate(whole, fraction) + self._harmonics(whole, fraction)[1][..., 2])

    def pole(self, whole: Array, fraction: Array) -> Pole:
        """Pole and celestial pole offsets at instants; the offsets are the daily ones."""
        daily = self.daily.pole(whole, fraction)
        added = (np.concatenate([two[..., :2], np.zeros_like(two[..., :2])], -1) for two in self._harmonics(whole, fraction))
        return Pole(*(of_day + within for of_day, within in zip(daily, added, strict=True)))

    def _harmonics(self, whole: Array, fraction: Array) -> tuple[Array, Array]:
        return subdaily(_mjd(whole, fraction, self.daily.ut1_tai(whole, fraction)))


WITHIN_THE_DAY = SubdailyEOP()  # by which positions that turn with the Earth are turned: those of files have it


def _mjd(whole: Array, fraction: Array, ut1_tai: Array) -> Array:
    """Modified Julian Date of UT1."""
    return np.asarray(51544.5 + (whole + fraction + ut1_tai - scales.TT_TAI) / scales.DAY)


def subdaily(mjd: Array) -> tuple[Array, Array]:
    """What is added to xp, yp (rad) and UT1 (s) at Modified Julian Dates of UT1, and its rates per second, both (K, 3)."""
    (a, da), (b, db) = ocean_tides(mjd), libration(mjd)
    return (a + b) * _UNITS, (da + db) * _UNITS / scales.DAY


def ocean_tides(mjd: Array) -> tuple[Array, Array]:
    """Tides of the oceans in x, y (uas) and UT1 (us), (K, 3), and their rates per day."""
    quarter = np.where(_POTENTIAL[:, 0] < 200.0, np.pi / 2.0, 0.0)
    angle = _POTENTIAL[:, 2] - quarter + _POTENTIAL[:, 3] * (np.asarray(mjd)[..., None] - _EPOCH)
    return _harmonic(angle, _POTENTIAL[:, 3], _RESPONSE)


def _responses() -> Array:
    """Complex amplitudes of x, y and UT1 at every line, (71, 3)."""
    order = (_POTENTIAL[:, 0] > 200.0).astype(int)
    one, two, back, three, back3, ahead = _ORTHOTIDES[order].T
    c, s = np.cos(_DELAY * _POTENTIAL[:, 3]), np.sin(_DELAY * _POTENTIAL[:, 3])
    orthotides = np.stack([one, two - 2.0 * back * c, three - 2.0 * back3 * c + 2.0 * ahead * s], -1)  # (71, 3)
    weights = (_WEIGHTS[:, 0::2] + 1j * _WEIGHTS[:, 1::2]).reshape(3, 2, 3)[:, order]  # (3, 71, 3)
    return np.asarray(_POTENTIAL[:, 1, None] * np.einsum("kln,ln->lk", weights, orthotides))


_RESPONSE = _responses()


def libration(mjd: Array) -> tuple[Array, Array]:
    """Diurnal libration of the pole (x, y; uas) and the semidiurnal one of UT1 (us), (K, 3), and their rates per day."""
    import erfa

    mjd = np.asarray(mjd)
    t = (mjd - 51544.5) / 36525.0
    arguments = [f(t) for f in (erfa.fal03, erfa.falp03, erfa.faf03, erfa.fad03, erfa.faom03)]
    angles = np.stack([erfa.gmst82(2400000.5, mjd) + np.pi, *arguments], -1)
    rates = np.concatenate([[_GMST_RATE], _ARGUMENT_RATES])
    none, pole, ut1 = np.zeros((len(_OF_POLE), 1)), _OF_POLE[:, 6:], _OF_UT1[:, 6:]
    of_pole = np.concatenate([pole[:, 1::2] - 1j * pole[:, 0::2], none], -1)
    of_ut1 = np.concatenate([np.zeros((len(ut1), 2)), ut1[:, 1:] - 1j * ut1[:, :1]], -1)
    lines = np.concatenate([_OF_POLE[:, :6], _OF_UT1[:, :6]])
    return _harmonic(angles @ lines.T, lines @ rates, np.concatenate([of_pole, of_ut1]))


def _harmonic(angle: Array, frequency: Array, amplitude: Array) -> tuple[Array, Array]:
    """Real part of the sum of amplitude exp(i angle) over lines, and its rate."""
    turned = np.exp(1j * angle)
    return (turned @ amplitude).real, (turned @ (1j * frequency[:, None] * amplitude)).real
