"""Precise orbits of SP3 files: values by hand from the files, scales, accuracies, and what is missing."""

import numpy as np
import pytest

import piazzi as pz

HEAD = """\
#{version}V2015  5  5  0  0  0.00000000       2   u+U {frame} FIT  GFZ
## 1843 172800.00000000   300.00000000 57147 0.0000000000000
+    2   G01E05  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0
++         6  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0
%c M  cc {scale} ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc
%f  1.2500000  1.025000000  0.00000000000  0.000000000000000
%i    0    0    0    0      0      0      0      0         0
/* comment
*  2015  5  5  0  0  0.00000000
PG01  13368.836676 -12067.323612  19408.991069     -5.982540
VG01  32349.234000 -61096.609000  29639.195000     20.000000
PE05      0.000000      0.000000      0.000000 999999.999999
*  2015  5  5  0  5  0.50000000
PG01  13427.144673 -11316.304150  19821.250975 999999.999999 18 20 22 219 EP  MP
EP  55  56  57     222  1234567 -1234567  5999999        1       -1       -1
PE05 -20525.786428  -1287.865100 -16954.601662   -245.585085  7  8  9
EOF
"""


def sp3(tmp_path, version="d", frame="IGS08", scale="GPS", **changes):
    text = HEAD.format(version=version, frame=frame.ljust(5), scale=scale)
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "a.sp3"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "name, arcs, states, scale, first, last, position, sigma",
    [
        ("gps_g01_g05_20150505.sp3", 2, 288, "GPS", "2015-05-05T00:00:00 GPS", "2015-05-05T23:55:00 GPS",
         (13368836.676, -12067323.612, 19408991.069), 0.064),
        ("three-hours.sp3", 2, 36, "GPS", "2015-05-05T00:00:00 GPS", "2015-05-05T02:55:00 GPS",
         (-32323399.959, 27093052.654, -172802.215), 1.024),
        ("issue1327-136-sats.sp3", 136, 4, "GPS", "2024-02-20T00:00:00 GPS", "2024-02-20T00:15:00 GPS",
         (-30637964.795, 25249134.782, 19304283.632), 0.016),
        ("truncated-nsgf.orb.lageos2.160305.v35.sp3", 1, 1, "UTC", "2016-02-28T00:00:00 UTC", "2016-02-28T00:00:00 UTC",
         (2228470.946, 7268265.924, 9581471.543), np.nan),
        ("nsgf.orb.stella.v00.sp3.gz", 1, 100, "UTC", "2023-12-08T00:00:00 UTC", "2023-12-08T04:57:00 UTC",
         (2447693.398, -1850426.620, -6499605.162), np.nan),
        *((f"{name}.sp3.Z", 3, 2, "GPS", "2018-06-16T00:00:00 GPS", "2018-06-16T00:15:00 GPS",
           (4159846.047, 15452860.127, -21680162.554), 0.128) for name in ("esaBHN", "esaPRO", "unknownType")),
    ],
)  # fmt: skip
def test_files_of_the_agencies(data_dir, name, arcs, states, scale, first, last, position, sigma):
    orbits = pz.read_ephemeris(data_dir / "earth" / "sp3" / name)
    assert orbits.format == "SP3" and len(orbits.arcs) == arcs and {len(arc) for arc in orbits.arcs} == {states}
    arc = orbits.arcs[0]
    assert (arc.scale, arc.frame, arc.centre) == (scale, "ITRF", "EARTH")
    assert abs(arc.instant(0) - pz.Epoch(first)) < 1e-9 and abs(arc.instant(states - 1) - pz.Epoch(last)) < 1e-9
    np.testing.assert_allclose(arc.position[0], position, rtol=0, atol=1e-3)
    np.testing.assert_allclose(arc.sigma[0], [sigma] * 3)


def test_velocities_of_stella_are_those_of_its_positions(data_dir):
    """Decimetres a second in the file: the fourth-order difference of positions 180 s apart agrees to 2 m/s."""
    arc = pz.read_ephemeris(data_dir / "earth" / "sp3" / "nsgf.orb.stella.v00.sp3.gz").arcs[0]
    np.testing.assert_allclose(arc.velocity[0], (3234.9234, -6109.6609, 2963.9195))
    np.testing.assert_allclose(arc.velocity[-1], (-4965.3915, -5628.1279, 394.85152))
    x = arc.position
    slope = (8 * (x[3:-1] - x[1:-3]) - (x[4:] - x[:-4])) / (12 * 180.0)
    assert np.abs(slope - arc.velocity[2:-2]).max() < 2.0


def test_clocks_that_are_missing(data_dir):
    arc = pz.read_ephemeris(data_dir / "earth" / "sp3" / "three-hours.sp3").of("C01")[0]
    assert arc.clock[0] == pytest.approx(-434.415658e-6, rel=1e-12)
    assert np.isnan(arc.clock[3]) and np.isfinite(arc.clock).sum() >= 34


def test_velocities_clocks_deviations_flags_and_what_is_missing(tmp_path):
    orbits = pz.read_ephemeris(sp3(tmp_path))
    first, second = orbits.arcs
    assert (first.name, second.name) == ("G01", "E05") and (len(first), len(second)) == (2, 1)
    np.testing.assert_allclose(first.velocity[0], (3234.9234, -6109.6609, 2963.9195))
    assert np.isnan(first.velocity[1]).all() and first.clock_rate[0] == pytest.approx(2e-9)
    np.testing.assert_allclose(first.sigma, [[0.064] * 3, [0.055, 0.056, 0.057]])  # the code 2^6 mm; then the line EP
    np.testing.assert_allclose(second.sigma, [[1e-3 * 1.25**k for k in (7, 8, 9)]])
    assert first.clock[0] == pytest.approx(-5.98254e-6) and np.isnan(first.clock[1])
    assert first.flags == ("", "clock event predicted clock manoeuvre predicted") and second.flags == ()
    assert first.t[1] - first.t[0] == pytest.approx(300.5, abs=1e-12)
    assert orbits.left_out == (("positions that are missing", 1),)
    said = dict(orbits.said)
    assert (said["frame"], said["agency"], said["comment"]) == ("IGS08", "GFZ", "comment")


@pytest.mark.parametrize(
    "scale, means",
    [
        ("GPS", "GPS"),
        ("GAL", "GPS"),
        ("QZS", "GPS"),
        ("IRN", "GPS"),
        ("UTC", "UTC"),
        ("GLO", "UTC"),
        ("TAI", "TAI"),
        ("ccc", "GPS"),
    ],
)
def test_each_scale(tmp_path, scale, means):
    orbits = pz.read_ephemeris(sp3(tmp_path, scale=scale))
    assert abs(orbits.arcs[0].instant(0) - pz.Epoch(f"2015-05-05T00:00:00 {means}")) < 1e-9
    assert bool(orbits.assumed) == (scale == "ccc")


def test_beidou_time_is_14_s_behind_gps(tmp_path):
    assert abs(pz.read_ephemeris(sp3(tmp_path, scale="BDT")).arcs[0].instant(0) - pz.Epoch("2015-05-05T00:00:14 GPS")) < 1e-9


@pytest.mark.parametrize(
    "frame, axes, assumed",
    [("ITRF", "ITRF", 0), ("IGS20", "ITRF", 0), ("UNDEF", "ITRF", 0), ("ECF", "ITRF", 0), ("SLR08", "ITRF", 0),
     ("J2000", "EME2000", 0), ("GCRF", "GCRF", 0), ("XYZ", "ITRF", 1)],
)  # fmt: skip
def test_names_of_axes(tmp_path, frame, axes, assumed):
    orbits = pz.read_ephemeris(sp3(tmp_path, frame=frame))
    assert orbits.arcs[0].frame == axes and len(orbits.assumed) == assumed


def test_satellites_of_version_a_have_numbers(tmp_path):
    changes = {"G01E05": "  1  5", "PG01": "P  1", "VG01": "V  1", "PE05": "P  5"}
    arc = pz.read_ephemeris(sp3(tmp_path, version="a", **changes)).arcs[0]
    assert arc.name == "G01" and arc.sigma[0, 0] == pytest.approx(0.064)


@pytest.mark.parametrize(
    "old, new, what",
    [
        ("EOF\n", "", "ends without EOF"),
        ("GPS ccc", "XYZ ccc", "line 5: time scale 'XYZ'"),
        ("13368.836676", "13368.x36676", "line 10: position of 'G01' is '13368.x36676'"),
        ("*  2015  5  5  0  5  0.5", "*  2015  5  5  0  0  0.0", "line 13: the epoch is not later"),
        ("*  2015  5  5  0  5  0.5", "*  2015  5 35  0  5  0.5", "line 13: 2015-5-35"),
        ("/* comment", "?? comment", "line 8: no line begins with"),
        ("#dV2015", "#eV2015", "no format that is known"),
        ("++         6", "++         x", "line 4: accuracy code"),
        ("%f  1.2500000", "%f  9999.0000", r"line 14: a standard deviation of 9999\*\*18 mm is no length"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, old, new, what):
    with pytest.raises(ValueError, match=what) as error:
        pz.read_ephemeris(sp3(tmp_path, **{old: new}))
    assert "\n" not in str(error.value) and "a.sp3" in str(error.value)


def test_fixes_have_the_accuracy_of_the_file_or_the_usual_one(tmp_path):
    """0.1 m where there is no code; velocities, which follow from the positions, are used with a sigma of the user's only."""
    path = sp3(tmp_path, **{"++         6  0": "++         0  0", "EP  55": "/* 55"})
    table = pz.read_tracking(path)
    assert np.all(table.sigma[table.of_kind("x", "y", "z")][:3] == 0.1)
    assert table.assumed == ("sigma of positions of SP3: 0.1 m",) and table.open == ()
    assert np.all(pz.read_tracking(path, sigma="2m").sigma[:3] == 2.0)


def test_velocities_of_fixes(data_dir):
    path = data_dir / "earth" / "sp3" / "nsgf.orb.stella.v00.sp3.gz"
    table = pz.read_tracking(path)
    moving = table.of_kind("vx", "vy", "vz")
    assert len(table) == 600 and moving.sum() == 300 and not table.used[moving].any() and table.used[~moving].all()
    assert pz.read_tracking(path, sigma="1mm/s").used.all()
