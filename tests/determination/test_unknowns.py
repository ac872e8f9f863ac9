"""The words of --estimate, --consider and --manoeuvre, and what becomes of them."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination.burns import Burn, burns_of
from piazzi.determination.earlier import STATES, Earlier
from piazzi.determination.motion import Extra, Numbers
from piazzi.determination.physical import (
    USUAL,
    at_rest,
    believed,
    by_shares,
    result_name,
    said,
    said_name,
    share_of,
    value_of,
    worth,
)
from piazzi.determination.ramps import RAMP, pieces, profiles
from piazzi.determination.unknowns import Label, asked, considered, listed
from piazzi.outside.function import Function

WHEN = "2026-11-03T04:12:00Z"


def test_a_list_of_unknowns_is_read_word_by_word():
    found = listed(f"cd/12h cr bias.range.7090/pass=1m clock.BER=1ms dv@{WHEN} cd~2h=30%")
    assert [(one.name, one.per, one.sigma, one.kind) for one in found] == [
        ("cd", "12h", None, ""), ("cr", None, None, ""), ("bias.range.7090", "pass", "1m", "bias"),
        ("clock.BER", None, "1ms", "clock"), (f"dv@{WHEN}", None, None, "dv"), ("cd", "~2h", "30%", ""),
    ]  # fmt: skip
    assert [found[0].period, found[2].size("m", 0.0), found[3].size("s", 0.0), found[5].period, found[5].size("", 0.0)] == [
        43200.0, 1.0, 1e-3, 7200.0, 0.3,
    ]  # fmt: skip
    assert found[4].epoch == pz.Epoch(WHEN)
    assert listed([pz.Estimated("cd", per="12h", sigma=0.5), "cr"])[0].size("", 9.0) == 0.5


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("cd/12", "cd/12 is '12'; write a length of time such as 60s, 10min, 6h or 3d"),
        ("cd//12h", "'cd//12h' cannot be read: write such as cd/12h cr"),
        ("5 cd", "'5' cannot be read"),
        ("bias.range=", "'bias.range=' cannot be read"),
        ("dv@2026-11-03T04:12:00", "no time scale"),
        ("cr cr=0.5", "cr is given twice"),
        ("cd=-1", "a sigma is positive, not -1"),
        ("cd=0.0", "a sigma is positive, not 0.0"),
    ],
)
def test_words_that_cannot_be_are_refused(words, says):
    with pytest.raises(ValueError, match=says.replace("(", r"\(")):
        asked(words, ())


def test_units_are_those_of_the_kind():
    (one,) = listed("clock.BER=1m")
    with pytest.raises(ValueError, match="unit such as s"):
        one.size("s", 0.0)
    (plain,) = listed("bias.range=1")
    with pytest.raises(ValueError, match="without a unit"):
        plain.size("m", 0.0)


def test_what_is_considered_has_a_sigma():
    assert [(one.name, one.sigma) for one in considered(["cr=0.1 bias.range=5cm"])] == [("cr", "0.1"), ("bias.range", "5cm")]
    assert considered({"cr": 0.1})[0].sigma == 0.1
    for words, says in (("cr", "has no sigma"), ("cd/12h=0.1", "one value, or one per pass")):
        with pytest.raises(ValueError, match=says):
            considered(words)


def test_a_manoeuvre_in_words():
    (arc,) = burns_of(f"{WHEN} dv=0,0.3,0m/s axes=RTN sigma=0.05m/s for=600s")
    assert arc == Burn(pz.Epoch(WHEN), (0.0, 0.3, 0.0), "RTN", (0.05, 0.05, 0.05), 0.0, 600.0)
    (scaled,) = burns_of(f"{WHEN} dv=0,30,0cm/s for=10min sigma=5% engine=A")
    assert (scaled.scale, scaled.engine, scaled.sigma, scaled.duration) == (0.05, "A", (0.0, 0.0, 0.0), 600.0)
    assert scaled.dv == pytest.approx((0.0, 0.3, 0.0))
    (usual,) = burns_of(f"{WHEN} dv=0,0,2m/s axes=TNW")
    assert usual.assumed and usual.sigma == pytest.approx((0.2, 0.2, 0.2))
    (thrust,) = burns_of(f"{WHEN} dv=0,0,2m/s axes=EME2000 for=60s")
    assert thrust.assumed and thrust.scale == 0.1 and thrust.axes == "EME2000"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (f"{WHEN[:-1]} dv=0,0.3,0m/s", "no time scale"),
        (f"{WHEN} dv=0,0.3m/s", "write three numbers and their unit"),
        (f"{WHEN} dv=0,0.3,0", "without a unit"),
        (f"{WHEN} dv=0,0.3,0m/s axis=RTN", "unknown name 'axis'; did you mean 'axes'"),
        (f"{WHEN} dv=0,0.3,0m/s axes=RTM", "axes 'RTM' are not known; did you mean 'RTN'"),
        (f"{WHEN} dv=0,0.3,0m/s axes=ITRF", "turn with the Earth"),
        (f"{WHEN} for=600s dv=0,0.3,0m/s sigma=-1m/s", "must not be negative"),
        (f"{WHEN} axes=RTN", "it has no dv"),
        (f"{WHEN} dv=0,1,0m/s RTN", "'RTN' stands alone"),
        (f"{WHEN} dv=0,1,0m/s engine=A sigma=1m/s", "have one scale"),
    ],
)
def test_manoeuvres_that_cannot_be_are_refused(words, says):
    with pytest.raises(ValueError, match=says):
        burns_of(words)


def test_manoeuvres_of_a_table(tmp_path):
    file = tmp_path / "burns.csv"
    rows = ["time, dv_1, dv_2, dv_3, axes, sigma, for", "2026-11-04T00:00:00Z, 0m/s, 1m/s, 0m/s, TNW, 5%, 30s"]
    file.write_text("\n".join([*rows, f"{WHEN}, 0m/s, 0m/s, 2m/s,,,"]))
    first, second = burns_of(str(file))
    assert (first.dv, first.axes, first.duration) == ((0.0, 0.0, 2.0), "RTN", 0.0)
    assert (second.dv, second.axes, second.scale, second.duration) == ((0.0, 1.0, 0.0), "TNW", 0.05, 30.0)
    file.write_text("time, dw\n")
    with pytest.raises(ValueError, match="line 1: unknown column 'dw'; known: time, dv, axes"):
        burns_of(str(file))
    file.write_text(f"time, dv\n{WHEN}, 3\n")
    with pytest.raises(ValueError, match="line 2: dv is '3'"):
        burns_of(str(file))


OPM = f"""CCSDS_OPM_VERS = 2.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = X
OBJECT_NAME = A
OBJECT_ID = 2020-001A
CENTER_NAME = EARTH
REF_FRAME = GCRF
TIME_SYSTEM = UTC
EPOCH = 2026-11-03T00:00:00
X = 7000
Y = 0
Z = 0
X_DOT = 0
Y_DOT = 7.5
Z_DOT = 0
MASS = 100
MAN_EPOCH_IGNITION = {WHEN[:-1]}
MAN_DURATION = 60
MAN_DELTA_MASS = -1
MAN_REF_FRAME = RTN
MAN_DV_1 = 0
MAN_DV_2 = 0.001
MAN_DV_3 = 0
"""
OCM = f"""CCSDS_OCM_VERS = 3.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = X
META_START
TIME_SYSTEM = UTC
EPOCH_TZERO = 2026-11-03T00:00:00
META_STOP
MAN_START
MAN_ID = 1
MAN_REF_FRAME = TNW_INERTIAL
MAN_COMPOSITION = TIME_ABSOLUTE, MAN_DURA, DV_X, DV_Y, DV_Z
MAN_UNITS = [n/a, s, m/s, m/s, m/s]
{WHEN[:-1]} 60 1.0 0 0
MAN_STOP
MAN_START
MAN_ID = 2
MAN_REF_FRAME = RTN
MAN_COMPOSITION = TIME_RELATIVE, DV_X, DV_Y, DV_Z
15120 0 0.001 0
MAN_STOP
"""


def test_manoeuvres_of_messages(tmp_path):
    file = tmp_path / "burns.opm"
    file.write_text(OPM)
    (burn,) = burns_of(file)
    assert burn == Burn(pz.Epoch(WHEN), (0.0, 1.0, 0.0), "RTN", (0.0, 0.0, 0.0), 0.1, 60.0, "", True)
    file.write_text(OCM)
    first, second = burns_of(file)
    assert (first.epoch, first.dv, first.axes, first.duration) == (pz.Epoch(WHEN), (1.0, 0.0, 0.0), "TNW", 60.0)
    assert abs(second.epoch - pz.Epoch(WHEN)) < 1e-9
    assert (second.dv, second.axes, second.duration) == ((0.0, 1.0, 0.0), "RTN", 0.0)


def uncertain():
    """A problem of one state with coefficients as determinations have them."""
    numbers = Numbers(
        {"cd_a_m": "estimated", "cr_a_m": "considered"},
        {"cd_a_m": pz.Gaussian(0.02, 0.01**2), "cr_a_m": pz.Gaussian(0.013, 0.0013**2)},
    )
    definitions = {"pull": "cd_a_m*x + cr_a_m"}
    extra = by_shares(numbers, Extra(), definitions)
    model = pz.Model(
        ("x",), {"x": "pull"}, pz.Sensor("s", {"z": "x"}), [pz.Parameter(n, r) for n, r in numbers.roles.items()],
        definitions=definitions | dict(extra.definitions),
    )  # fmt: skip
    return pz.Problem(model, pz.Gaussian([1.0], [1.0]), stations=[pz.Station("a", "s", [1.0])], parameters=numbers.values)


def test_coefficients_are_positive_whatever_is_estimated():
    problem = uncertain()
    assert problem.model.names == ("x", "cd_a_m_share") and problem.considered == ("cr_a_m_share",)
    for share in (-3.0, 0.0, USUAL, 4.0):
        mean = np.array([5.0, share])
        values, J = said(problem, mean)
        assert values[1] == pytest.approx(0.01 * (share + np.sqrt(share**2 + 0.04))) and values[1] > 0 and values[0] == 5.0
        near = said(problem, np.array([5.0, share + 1e-6]))[0] - said(problem, np.array([5.0, share - 1e-6]))[0]
        np.testing.assert_allclose(J[:, 1], near / 2e-6, rtol=1e-6)
        assert problem.dynamics(mean, 0.0)[0] == pytest.approx(5.0 * values[1] + 0.013)
    # a straight line above a fifth of the usual, to some percent of that
    share = np.linspace(0.2, 5.0, 50)
    np.testing.assert_allclose(value_of(share), share, atol=0.05)
    np.testing.assert_allclose(share_of(value_of(share)), share, rtol=1e-12)
    for name, x in (("cd_a_m_share", 0.3), ("cd_a_m_log", -0.7)):
        value, slope = worth(name, x)
        assert value > 0 and slope == pytest.approx((worth(name, x + 1e-6)[0] - worth(name, x - 1e-6)[0]) / 2e-6)
    assert believed(problem, "cd_a_m_share") == pytest.approx((0.02, 0.01), rel=0.01)
    assert believed(problem, "cr_a_m_share") == pytest.approx((0.013, 0.0013), rel=0.01)
    assert [said_name(n) for n in ("cd_a_m_2_share", "cd_a_m_log", "cd_a_m_change", "air_3", "range_share")] == [
        "cd_a_m_2", "cd_a_m", "cd_a_m_change", "density_3", "range_share",
    ]  # fmt: skip


def test_a_coefficient_of_nothing_cannot_be_estimated():
    numbers = Numbers({"cd_a_m": "estimated"}, {"cd_a_m": pz.Gaussian(0.0, 1.0)})
    with pytest.raises(ValueError, match="cd_a_m is 0 before the measurements"):
        by_shares(numbers, Extra(), {"pull": "cd_a_m*x"})


def test_constants_at_rest_are_states_with_the_same_numbers():
    problem = uncertain()
    moved = at_rest(problem, ["cd_a_m_share"])
    assert moved.model.states == ("x", "cd_a_m_share") and moved.model.names == problem.model.names
    np.testing.assert_array_equal(moved.covariance, problem.covariance)
    np.testing.assert_array_equal(moved.mean, problem.mean)
    assert moved.dynamics(moved.mean, 0.0)[1] == 0.0 and moved.is_noise_free


def test_values_for_parts_of_the_time_change_over_a_ramp():
    of = Function(pieces(3), 4, 1, [(0, k) for k in (1, 2, 3)], [10.0, 20.0])
    for t, wanted in ((0.0, 5.0), (10.0 - RAMP, 5.0), (10.0, 6.0), (10.0 + RAMP, 7.0), (20.0 + RAMP, -1.0), (1e6, -1.0)):
        assert of.value(t, 5.0, 7.0, -1.0)[0] == pytest.approx(wanted)
        share = of.derivatives(t, 5.0, 7.0, -1.0)[0, 1:]
        assert share.sum() == pytest.approx(1.0) and share @ [5.0, 7.0, -1.0] == pytest.approx(wanted)


def test_a_profile_has_the_area_one():
    of = Function(profiles(2), 1, 2, [], [10.0, 12.0, 50.0, 51.0])
    t = np.linspace(0.0, 60.0, 600001)
    values = np.array([of.value(x) for x in t[95000:125000:10]])[:, 0]
    assert np.trapezoid(values, t[95000:125000:10]) == pytest.approx(1.0, abs=1e-3)
    assert of.value(11.0) == (0.5, 0.0) and of.value(50.5) == (0.0, 1.0)


def test_another_night_knows_a_value_again_by_what_it_is_of_not_by_its_number():
    before = Earlier(pz.Epoch(WHEN), np.zeros(7), np.eye(7), "last.json", names=(*STATES, "bias.range.7090"))
    for station, place in (("7090", 6), ("7119", None)):
        labels = {"range_bias_1": Label(f"bias.range.{station}", "")}
        assert before.place(result_name(labels, "range_bias_1"), 0.0, 0.0) == place
    assert result_name({}, "cd_a_m_share") == "cd_a_m"
