"""Yesterday's orbit as the prior of tonight's: nothing is used twice, nothing is lost."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.determination.earlier import earlier_of
from tests.determination.fixing import EPOCH, observations, truth

T = np.arange(0.0, 2 * 43200.0, 1200.0)
SIGMA = 5.0
pytestmark = pytest.mark.slow  # forces of which nothing is estimated are a kernel of their own
HALF = T < 43200.0
KNOWN = "gravity=EGM2008 degree=12 radiation=cannonball cr_a_m=0.023"  # nothing but the orbit is unknown


@pytest.fixture(scope="module")
def noisy():
    return truth(T)[:, :3] + SIGMA * np.random.default_rng(3).standard_normal((len(T), 3))


@pytest.fixture(scope="module")
def chain(noisy):
    """One fit of all, that of the first half, and that of all rows with the first half's orbit as the prior."""
    whole = pz.determine(observations(noisy, T, SIGMA), forces=KNOWN)
    first = pz.determine(observations(noisy[HALF], T[HALF], SIGMA), forces=KNOWN)
    return whole, first, pz.determine(observations(noisy, T, SIGMA), forces=KNOWN, prior=first)


def sigmas_apart(one, other, epoch):
    sigma = np.sqrt(np.diag(one.orbit.covariance(epoch)))
    return np.max(np.abs(one.orbit.at(epoch) - other.orbit.at(epoch)) / sigma)


def test_two_halves_say_what_one_fit_says(chain):
    """Without process noise the prior is the information of the first half, so both posteriors are the same."""
    whole, _, then = chain
    assert then.determined and abs(then.epoch - whole.epoch) < 1e-9
    edits = max(int((~found.keep).sum()) for found in chain)
    assert sigmas_apart(whole, then, whole.epoch) < 0.02 + 0.3 * edits  # rows that one of them leaves out
    ratio = np.diag(then.orbit.covariance()) / np.diag(whole.orbit.covariance())
    assert_allclose(ratio, 1.0, rtol=0.02 + 0.05 * edits)


def test_constants_go_on_with_their_correlations(noisy):
    """What the first half says of sunlight is correlated with its orbit: with both, two halves say what one fit says."""
    forces = KNOWN.removesuffix(" cr_a_m=0.023")
    whole = pz.determine(observations(noisy, T, SIGMA), forces=forces)
    first = pz.determine(observations(noisy[HALF], T[HALF], SIGMA), forces=forces)
    then = pz.determine(observations(noisy, T, SIGMA), forces=forces, prior=first)
    for found in (whole, then):
        assert found.determined, found.message
    one, two = (found.to_dict() for found in (whole, then))
    sigma, miss = np.array(one["sigma"]), np.array(two["mean"]) - np.array(one["mean"])
    edits = max(int((~found.keep).sum()) for found in (whole, first, then))
    assert two["names"] == one["names"] and np.max(np.abs(miss) / sigma) < 0.05 + 0.3 * edits
    assert_allclose(two["sigma"], sigma, rtol=0.02 + 0.05 * edits)


def test_what_was_used_is_left_out_and_counted(chain):
    _, first, then = chain
    facts = then.to_dict()
    assert facts["left_out"]["measurements that the prior has used already"] == 3 * int(HALF.sum())
    assert sum(one["count"] for one in facts["residuals"]) == 3 * int((~HALF).sum())
    assert facts["prior"]["first"] == first.to_dict()["span"]["first"]


def test_every_file_with_a_covariance_is_a_prior(chain, noisy, tmp_path):
    _, first, then = chain
    rows = observations(noisy, T, SIGMA)
    for name, apart in (
        ("first.json", 1e-3),
        ("first.nc", 1e-3),
        ("first.ocm", 1e-3),
        ("first.oem", 0.02),
        ("first.opm", 0.02),
    ):
        path = tmp_path / name  # all of them say which measurements they were made of
        first.write(path)
        again = pz.determine(rows, forces=KNOWN, prior=path)
        assert sigmas_apart(then, again, then.epoch) < apart, name
        assert again.to_dict()["left_out"][f"measurements that {path} has used already"] == 3 * int(HALF.sum())
    then.write(tmp_path / "then.opm")  # of a chain all measurements are told, those of the first orbit too
    assert earlier_of(tmp_path / "then.opm", EPOCH).used[0] - EPOCH == pytest.approx(T[0], abs=1e-6)


@pytest.mark.parametrize("ending", ["oem", "opm"])
@pytest.mark.parametrize("change", ["without", "twice", "reworded", "backwards"])
def test_a_message_that_does_not_say_what_it_is_made_of_is_asked_about(chain, noisy, tmp_path, ending, change):
    first, rows, path = chain[1], observations(noisy, T, SIGMA), tmp_path / f"first.{ending}"
    first.write(path)
    text = path.read_text()
    line = next(line for line in text.splitlines(keepends=True) if line.startswith("COMMENT Measurements from"))
    begin, end = line.removeprefix("COMMENT Measurements from ").removesuffix(".\n").split(" to ")
    other = {"without": "", "twice": 2 * line, "reworded": line.replace("from", "of", 1)}
    path.write_text(text.replace(line, other.get(change, f"COMMENT Measurements from {end} to {begin}.\n")))
    assert earlier_of(path, EPOCH).used is None
    with pytest.raises(ValueError, match=r"which measurements is it made of.*--from"):
        pz.determine(rows, forces=KNOWN, prior=path)
    again = pz.determine(rows, forces=KNOWN, prior=path, from_=EPOCH + 43200.0)
    assert sigmas_apart(chain[2], again, chain[2].epoch) < 0.02


def test_one_measurement_is_enough_beside_a_prior(chain, noisy):
    _, first, _ = chain
    k = int(np.flatnonzero(~HALF)[3])
    found = pz.determine(observations(noisy[k : k + 1], T[k : k + 1], SIGMA), forces=KNOWN, prior=first)
    assert found.determined and "and the prior determine" in found.verdict["seen"].sentence
    # as a filter has it, in the axes of the first row: one update of the prior that was carried there
    mean, root = found.setup.before
    P, H = root @ root.T, np.eye(3, 6)
    gain = np.linalg.solve(H @ P @ H.T + SIGMA**2 * np.eye(3), H @ P).T
    assert_allclose(found.orbit.at(), mean + gain @ (noisy[k] - mean[:3]), rtol=0, atol=1e-3)
    assert_allclose(found.orbit.covariance(), P - gain @ H @ P, rtol=1e-3, atol=1e-9 * P.max())


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"determined": False}, "not determined"),
        ({"schema": "other/1"}, "the schema is 'other/1'"),
        ({"covariance": None}, "no state with a covariance"),
        ({"covariance": [[1.0]]}, "no state with a covariance"),
        ({"mean": [None] * 6}, "no state with a covariance"),
        ({"span": {"first": "2015-05-04T00:00:00 UTC", "last": "2015-06-05T00:00:00 UTC"}}, "all 216 measurements already"),
        ({"span": {"first": None, "last": None}}, "--from"),
    ],
)
def test_what_is_no_prior_is_said(chain, noisy, tmp_path, change, says):
    (tmp_path / "x.json").write_text(json.dumps(chain[1].to_dict() | change))
    with pytest.raises(ValueError, match=says):
        pz.determine(observations(noisy, T, SIGMA), forces=KNOWN, prior=tmp_path / "x.json")


def test_an_orbit_without_a_covariance_is_a_guess_only(noisy, tmp_path):
    from piazzi.formats import Arc, Ephemeris, oem_text

    states = truth(T[:3])
    arc = Arc(epoch=EPOCH, t=T[:3], position=states[:, :3], velocity=states[:, 3:], centre="EARTH", frame="GCRF", scale="UTC")
    (tmp_path / "bare.oem").write_text(oem_text(Ephemeris(arcs=(arc,))))
    with pytest.raises(ValueError, match="has no covariance: it can be a --guess, no prior"):
        pz.determine(observations(noisy, T, SIGMA), prior=tmp_path / "bare.oem", from_=EPOCH)
    with pytest.raises(ValueError, match="--prior, which is not given"):
        pz.determine(observations(noisy, T, SIGMA), from_=EPOCH)


def test_a_prior_of_after_the_first_new_row_is_refused_with_what_helps(noisy, tmp_path):
    from piazzi.formats import Arc, ocm_text

    state = truth(T[:2])[1]
    arc = Arc(
        epoch=EPOCH + 1200.0, t=np.zeros(1), position=state[None, :3], velocity=state[None, 3:], centre="EARTH", frame="GCRF",
        scale="UTC", covariance_t=np.zeros(1), covariance=np.diag([1e2] * 3 + [1e-4] * 3)[None], covariance_frames=("GCRF",),
    )  # fmt: skip
    (tmp_path / "x.ocm").write_text(ocm_text(arc))
    with pytest.raises(
        ValueError, match=r"x.ocm: it is of 2015-05-05T00:20:00 UTC.* at 2015-05-05T00:00:00 UTC.*--from 2015-05-05T00:20:00Z"
    ):
        pz.determine(observations(noisy, T, SIGMA), forces=KNOWN, prior=tmp_path / "x.ocm", from_=EPOCH)


def test_sigmas_that_were_too_small_are_taken_larger(noisy):
    first = pz.determine(observations(noisy[HALF], T[HALF], SIGMA / 4), forces=KNOWN)
    then = pz.determine(observations(noisy, T, SIGMA), forces=KNOWN, prior=first)
    factor = first.verdict["honest"].figure
    assert factor > 2 and any(f"{factor:.3g} times as large" in text for text in then.setup.assumed)
    assert_allclose(then.setup.earlier.covariance, factor**2 * first.orbit.covariance(), rtol=1e-6)
