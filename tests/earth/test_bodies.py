"""Sun, Moon and planets: against DE440, and kernels against the series that they were made of."""

import struct
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi import earth
from piazzi.earth import Epoch

# Geocentric (Sun, Moon) and heliocentric positions (m) and velocities (m/s) of JPL DE440 on ICRF axes, read with jplephem
DE440 = {
    ("sun", "earth", "1960-07-01T00:00:00"): (-25657067957, 137544647012, 59647354346, -28875.9490, -4519.2651, -1958.9157),
    ("sun", "earth", "1995-03-12T06:00:00"): (146913512152, -20708505928, -8978649360, 4998.9699, 27110.9439, 11754.1153),
    ("sun", "earth", "2016-02-13T16:00:00"): (119735064748, -79346544065, -34398426525, 17921.0938, 22268.8546, 9652.6840),
    ("sun", "earth", "2026-11-29T12:00:00"): (-57898899041, -124537541092, -53983978222, 27875.0190, -10626.8423, -4607.8736),
    ("moon", "earth", "1960-07-01T00:00:00"): (-389176032, 23829140, 15189770, -11.8605, -952.1129, -317.8128),
    ("moon", "earth", "1995-03-12T06:00:00"): (-151181686, 348180474, 113366672, -893.9643, -383.0207, -185.1065),
    ("moon", "earth", "2016-02-13T16:00:00"): (310213347, 189315139, 58167732, -547.1380, 865.1840, 292.7438),
    ("moon", "earth", "2026-11-29T12:00:00"): (-258072210, 240041146, 109681577, -793.5281, -605.4383, -361.9777),
    ("venus", "sun", "1995-03-12T06:00:00"): (-39006582595, -93273098236, -39492008147, 32442.9326, -10871.4768, -6944.2053),
    ("venus", "sun", "2026-11-29T12:00:00"): (2305047056, 98221251516, 44051465434, -35131.5015, -289.7587, 2092.2569),
    ("jupiter", "sun", "1960-07-01T00:00:00"): (2435766027, -722056778839, -309589379773, 12923.1308, 719.2420, -6.6945),
    ("jupiter", "sun", "2026-11-29T12:00:00"): (-571697300207, 504877954891, 230320714674, -9259.2270, -8147.3708, -3266.7893),
}  # fmt: skip
# what the guide says of the series between 1960 and 2050, in m and m/s
STATED = {"sun": (11e3, 0.0041), "moon": (30e3, 0.18), "venus": (3.2e6, 1.9), "jupiter": (173e6, 16.0)}


@pytest.mark.parametrize(("name", "center", "date"), DE440)
def test_series_against_de440(name, center, date):
    position, velocity = earth.body(name, Epoch(f"{date} TDB"), center)
    there = np.array(DE440[name, center, date])
    metres, per_second = STATED[name]
    assert np.linalg.norm(position - there[:3]) < metres
    assert np.linalg.norm(velocity - there[3:]) < per_second


def test_the_earth_of_1800_against_de440(data_dir):
    table = np.loadtxt(data_dir / "earth/ceres-1801/earth_heliocentric_de440.csv", delimiter=",", skiprows=1)
    position, velocity = earth.body("earth", [Epoch.from_jd(jd, 0.0, "TDB") for jd in table[:, 0]], "sun")
    away = np.linalg.norm(position - 1e3 * table[:, 1:4], axis=1)
    assert away.max() < 14.1e3
    assert np.linalg.norm(velocity - 1e3 * table[:, 4:], axis=1).max() < 0.0042


@pytest.mark.parametrize("name", ["sun", "moon", "mercury", "venus", "mars", "jupiter", "saturn", "uranus", "neptune"])
def test_velocity_is_the_rate_of_the_position(name):
    epoch, step = Epoch("2016-02-13 TDB"), 600.0
    ahead, behind = earth.body(name, epoch + step)[0], earth.body(name, epoch - step)[0]
    _, velocity = earth.body(name, epoch)
    # plan94 takes velocities from osculating elements: 1e-3 of them
    bar = 3e-3 if name in ("sun", "moon") else 40.0
    assert_allclose((ahead - behind) / (2 * step), velocity, rtol=0, atol=bar)


def test_sums_close():
    days = [Epoch("2016-02-13 TDB") + 86400.0 * k for k in range(5)]
    moon = earth.body("moon", days, "sun")[0]
    assert_allclose(moon - earth.body("earth", days, "sun")[0], earth.body("moon", days)[0], rtol=0, atol=1e-4)
    assert_allclose(earth.body("earth", days, "mars")[0], -earth.body("mars", days, "earth")[0], rtol=0, atol=0)
    assert_allclose(earth.body("earth", days)[0], 0.0, rtol=0, atol=0)
    assert_allclose(earth.body("moon", days)[0][2], earth.body("moon", days[2])[0], rtol=1e-15, atol=0)


def write_spk(path, segments, start, end):
    """A binary SPK file (NAIF DAF) of type 2: one Chebyshev record for each (target, center, (3, n) coefficients in km)."""
    middle, radius = (start + end) / 2, (end - start) / 2
    words, summaries, first = [], [], 3 * 128 + 1
    for target, center, coefficients in segments:
        record = [middle, radius, *np.ravel(coefficients)]
        data = [*record, start, end - start, float(len(record)), 1.0]
        last = first + len(data) - 1
        summaries.append(struct.pack("<2d6i", start, end, target, center, 1, 2, first, last))
        words, first = words + data, last + 1
    head = struct.pack("<8sii60siii8s", b"DAF/SPK ", 2, 6, b"test".ljust(60), 2, 2, first, b"LTL-IEEE")
    head = head.ljust(699, b"\0") + b"FTPSTR:\r:\n:\r\n:\r\x00:\x81:\x10\xce:ENDFTP".ljust(325, b"\0")
    block = (struct.pack("<3d", 0.0, 0.0, float(len(segments))) + b"".join(summaries)).ljust(1024, b"\0")
    path.write_bytes(head + block + b" " * 1024 + struct.pack(f"<{len(words)}d", *words))


@pytest.fixture
def kernel(tmp_path):
    """Sun and Moon of four days, fitted to the series, with the links that kernels of JPL have."""
    pytest.importorskip("jplephem")
    first = Epoch("2016-02-12 TDB")
    start = (first.jd("TDB")[0] - 2451545.0) * 86400.0
    nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
    days = [first + 172800.0 * (1.0 + x) for x in nodes]

    def fit(values):
        return np.polynomial.chebyshev.chebfit(nodes, values / 1e3, 15).T

    earth_moon, earth_sun = earth.body("moon", days)[0], earth.body("earth", days, "sun")[0]
    share = 0.01215
    segments = [
        (10, 0, np.zeros((3, 16))), (3, 0, fit(earth_sun + share * earth_moon)), (399, 3, fit(-share * earth_moon)),
        (301, 3, fit((1 - share) * earth_moon)),
    ]  # fmt: skip
    write_spk(tmp_path / "small.bsp", segments, start, start + 345600.0)
    return tmp_path / "small.bsp"


def test_a_kernel(kernel):
    days = [Epoch("2016-02-12T01:00:00 TDB") + 20000.0 * k for k in range(16)]
    for name, center in (("moon", "earth"), ("sun", "earth"), ("moon", "sun"), ("earth", "moon")):
        (position, velocity), known = earth.body(name, days, center, kernel), earth.body(name, days, center)[0]
        assert_allclose(position, known, rtol=0, atol=3.0)
        ahead, behind = (earth.body(name, [d + dt for d in days], center, kernel)[0] for dt in (60.0, -60.0))
        assert_allclose((ahead - behind) / 120.0, velocity, rtol=0, atol=3e-4)
        one = earth.body(name, days[3], center, str(kernel))
        assert one[0].shape == (3,)
        assert_allclose(one[0], earth.body(name, days, center, kernel)[0][3], rtol=1e-15)


def test_what_a_kernel_does_not_have_is_said(kernel, tmp_path):
    with pytest.raises(ValueError, match=r"small.bsp has moon from 2016-02-12.* to 2016-02-16.* TDB, not at 2017-02-13"):
        earth.body("moon", [Epoch("2016-02-13 TDB"), Epoch("2017-02-13 TDB")], kernel=kernel)
    with pytest.raises(ValueError, match=r"small.bsp has no body jupiter; it has 3, earth, moon, sun"):
        earth.body("jupiter", Epoch("2016-02-13 TDB"), kernel=kernel)
    with pytest.raises(OSError, match=r"none\.bsp"):
        earth.body("moon", Epoch("2016-02-13 TDB"), kernel=tmp_path / "none.bsp")
    (tmp_path / "text.bsp").write_text("not a kernel\n" * 100)
    with pytest.raises(ValueError, match=r"text\.bsp is no binary SPK kernel"):
        earth.body("moon", Epoch("2016-02-13 TDB"), kernel=tmp_path / "text.bsp")


def test_without_jplephem_the_extra_is_named(kernel, monkeypatch):
    monkeypatch.setitem(sys.modules, "jplephem", None)
    with pytest.raises(ValueError, match=r"piazzi\[jpl\]"):
        earth.body("moon", Epoch("2016-02-13 TDB"), kernel=kernel)


def test_unknown_bodies_are_met_with_the_nearest():
    with pytest.raises(ValueError, match="'jupitre' is not known; did you mean 'jupiter'"):
        earth.body("jupitre", Epoch("2016-02-13 TDB"))
    with pytest.raises(ValueError, match="pluto has no series; give a JPL kernel"):
        earth.body("pluto", Epoch("2016-02-13 TDB"))


def test_a_damaged_kernel_is_said_to_be(kernel):
    good = kernel.read_bytes()
    for place, value, said in (
        (1024, struct.pack("<d", 2.0), "goes to record 2"),  # a list that leads to itself
        (1024, struct.pack("<d", 1e9), "damaged: record 2"),
        (1040, struct.pack("<d", 1e9), "damaged: record 2"),
        (1024 + 24 + 36, struct.pack("<i", 10**9), "cannot be read"),
    ):
        damaged = kernel.with_name(f"damaged-{place}-{value[-1]}.bsp")
        damaged.write_bytes(good[:place] + value + good[place + len(value) :])
        with pytest.raises(ValueError, match=said):
            earth.body("sun", Epoch("2016-02-13 TDB"), kernel=damaged)
    short = kernel.with_name("short.bsp")
    short.write_bytes(good[:-8])
    with pytest.raises(ValueError, match="bytes"):
        earth.body("sun", Epoch("2016-02-13 TDB"), kernel=short)
