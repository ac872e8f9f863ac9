"""Forces of [earth] in a scenario, and truths with other ones."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.present.equations import equations
from piazzi.problem.truth import true_problem
from piazzi.scenarios import ScenarioError, load_scenario

X = [7000e3, 100e3, -50e3, 10.0, 5.0e3, 5.5e3]
EPOCH = pz.Epoch("2016-02-13T16:00:00 UTC")
FILE = """
epoch = "2016-02-13T16:00:00 UTC"
[earth]
degree = 4
{earth}
[parameters]
{parameters}
[sensors.position.components]
px = "x"
py = "y"
pz = "z"
[[stations]]
name = "fixes"
noise = {{ sigma = [1.0, 1.0, 1.0] }}
[prior]
mean = [7000e3, 100e3, -50e3, 10.0, 5.0e3, 5.5e3]
sigma = [10.0, 10.0, 10.0, 0.01, 0.01, 0.01]
[times]
step = 60.0
count = 3
{more}
"""


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def load(tmp_path, earth="", parameters="", more="", text=FILE):
    path = tmp_path / "mine.toml"
    path.write_text(text.format(earth=earth, parameters=parameters, more=more))
    return load_scenario(path).problem


def rates(problem, x=X, t=100.0):
    return problem.dynamics([*x, *[0.0] * (problem.model.n - len(x))], t)[:6]


def expected(forces, **parameters):
    problem = pz.Problem(
        forces.model(),
        pz.Gaussian(X, [1.0] * 6),
        parameters={**forces.values, **parameters},
        functions=forces.functions(EPOCH),
        epoch=EPOCH,
        prior_time=0.0,
    )
    return rates(problem)


def test_forces_are_those_of_python(tmp_path):
    """Every field of Forces is a key, with the same numbers; coefficients are parameters in every role."""
    problem = load(
        tmp_path,
        'bodies = ["sun", "moon", "venus"]\nradiation = "cannonball"\ndrag = "exponential"\n'
        'air_height = "600 km"\nempirical = ["along"]',
        'cr_a_m = { value = 0.02, sigma = 0.002, role = "estimated" }\ncd_a_m = 0.01\n'
        'along = { value = 1e-8, sigma = 1e-9, role = "considered" }',
    )
    forces = earth.Forces(
        degree=4,
        bodies=("sun", "moon", "venus"),
        radiation="cannonball",
        drag="exponential",
        air_height=600e3,
        empirical=("along",),
    )
    assert problem.model.names == ("x", "y", "z", "vx", "vy", "vz", "cr_a_m")
    assert problem.considered == ("along",)
    assert problem.model.unit("x") == "m"
    assert problem.model.unit("cr_a_m") == "m^2/kg"
    assert dict(problem.model.groups)["position"] == ("x", "y", "z")
    x = [*X, 0.02]
    np.testing.assert_array_equal(problem.dynamics(x, 100.0)[:6], expected(forces, cr_a_m=0.02, cd_a_m=0.01, along=1e-8))


def test_own_forces_states_and_definitions(tmp_path):
    """Text in [dynamics] is added to the forces; names of the forces are there for it, and for sensors."""
    base = load(tmp_path)
    problem = load(
        tmp_path,
        parameters="thrust = 1e-3",
        more='[states]\nmass = "kg"\n[definitions]\npush = "thrust/mass*r/r"\n[dynamics]\nvx = "push"\nmass = "-0.1"',
        text=FILE.replace("5.5e3]", "5.5e3, 100.0]").replace("0.01]", "0.01, 1.0]"),
    )
    assert problem.model.states == (*earth.forces.STATES, "mass")
    with_mass = problem.dynamics([*X, 50.0], 100.0)
    np.testing.assert_allclose(with_mass[:6] - rates(base), [0, 0, 0, 1e-3 / 50.0, 0, 0], atol=1e-17)
    assert with_mass[6] == -0.1


def test_a_definition_of_ones_own_replaces_that_of_a_force(tmp_path):
    drag = 'drag = "exponential"'
    air = load(tmp_path, drag, "cd_a_m = 0.01")
    none = load(tmp_path, drag, "cd_a_m = 0.01", '[definitions]\ndensity = "0*altitude"')
    assert np.abs(rates(air) - rates(none)).max() > 1e-10
    np.testing.assert_allclose(rates(none), rates(load(tmp_path)), rtol=1e-15)


def test_units_of_the_file_are_for_numbers(tmp_path):
    text = FILE.replace("[earth]", 'units = "km"\n[earth]').replace(
        "7000e3, 100e3, -50e3, 10.0, 5.0e3, 5.5e3", "7000.0, 100.0, -50.0, 0.01, 5.0, 5.5"
    )
    text = text.replace("[1.0, 1.0, 1.0]", "[0.001, 0.001, 0.001]").replace(
        "[10.0, 10.0, 10.0, 0.01, 0.01, 0.01]", "[0.01, 0.01, 0.01, 1e-5, 1e-5, 1e-5]"
    )
    for name in "xyz":
        text = text.replace(f'p{name} = "{name}"', f'p{name} = {{{{ equation = "{name}", unit = "length" }}}}')
    problem = load(tmp_path, text=text)
    np.testing.assert_allclose(problem.prior.mean, X, rtol=1e-15)
    np.testing.assert_allclose(np.sqrt(np.diag(problem.prior.covariance)), [10.0] * 3 + [0.01] * 3)
    assert problem.stations[0].noise[0, 0] == pytest.approx(1.0)
    np.testing.assert_array_equal(rates(problem), expected(earth.Forces(degree=4)))


def test_data_are_beside_the_file(tmp_path, data_dir):
    (tmp_path / "mine.gfc").write_bytes((data_dir / "earth" / "gravity" / "GGM05S.gfc").read_bytes())
    problem = load(tmp_path, 'gravity = "mine.gfc"\neop = { ut1_utc = 0.25 }')
    forces = earth.Forces(tmp_path / "mine.gfc", 4)
    assert problem.functions["field"].checksum == forces.functions(EPOCH)["field"].checksum
    assert problem.functions["fixed"].eop == earth.EOP(ut1_utc=0.25)


# ---- truth with other physics ---------------------------------------------------------------------------------------


def test_true_forces_are_those_of_the_other_table(tmp_path):
    problem = load(
        tmp_path,
        'drag = "exponential"',
        "cd_a_m = 0.01",
        '[truth.earth]\ndegree = 10\nbodies = ["sun"]\nradiation = "cannonball"\neop = { ut1_utc = 0.1 }\n'
        "[truth.parameters]\ncr_a_m = 0.03\nair_density = 1e-12",
    )
    np.testing.assert_array_equal(rates(problem), expected(earth.Forces(degree=4, drag="exponential"), cd_a_m=0.01))
    true = true_problem(problem)
    forces = earth.Forces(degree=10, bodies=("sun",), drag="exponential", radiation="cannonball")
    other = pz.Problem(
        forces.model(),
        pz.Gaussian(X, [1.0] * 6),
        parameters={**forces.values, "cd_a_m": 0.01, "cr_a_m": 0.03, "air_density": 1e-12},
        functions=forces.functions(EPOCH, earth.EOP(ut1_utc=0.1)),
        epoch=EPOCH,
        prior_time=0.0,
    )
    np.testing.assert_allclose(rates(true), rates(other), rtol=1e-15)
    assert true.model.names == problem.model.names


def test_another_true_degree_is_the_same_model(tmp_path):
    problem = load(tmp_path, more="[truth.earth]\ndegree = 10")
    true = true_problem(problem)
    assert true.model == problem.model
    assert true.functions["field"].degree == 10
    assert problem.functions["field"].degree == 4
    different = equations(problem).partition("# what is true instead\n")[2].splitlines()
    assert [line[:6] for line in different] == ["field:"]
    assert "to degree 10" in different[0]


def test_true_definitions(tmp_path):
    problem = load(
        tmp_path,
        'drag = "exponential"',
        "cd_a_m = 0.01",
        '[truth.definitions]\ndensity = "2*air_density*exp((air_height - altitude)/air_scale)*(1 + wave*sin(t/900))"\n'
        "[truth.parameters]\nwave = 0.0",
    )
    none = load(tmp_path, 'drag = "exponential"', "cd_a_m = 0.0")
    push, double = (rates(p) - rates(none) for p in (problem, true_problem(problem)))
    np.testing.assert_allclose(double[3:], 2.0 * push[3:], rtol=1e-6)


def test_true_rates_and_stations_of_any_scenario(tmp_path):
    path = tmp_path / "cart.toml"
    path.write_text(
        """
states = ["x", "v"]
dynamics = { x = "v", v = "-x" }
parameters = { k = 2.0 }
prior = { mean = [1.0, 0.0], sigma = [0.1, 0.1] }
times = { step = 1.0, count = 3 }
[sensors.ruler]
numbers = ["mark"]
components = { d = "x - mark + 0*k" }
[[stations]]
name = "north"
noise = { sigma = 0.1 }
numbers = { mark = 5.0 }
[truth]
state = [1.0, 0.0]
measurement_noise = false
dynamics = { v = "-x - c*v" }
parameters = { c = 0.3 }
stations = { north = { mark = 6.0 } }
"""
    )
    problem, tracking = pz.load(path)
    assert true_problem(problem).dynamics([1.0, 2.0], 0.0).tolist() == [2.0, -1.6]
    assert problem.dynamics([1.0, 2.0], 0.0).tolist() == [2.0, -1.0]
    np.testing.assert_allclose(tracking.values[:, 0], tracking.truth[:, 0] - 6.0, rtol=1e-14)


def test_studies_vary_the_true_degree(tmp_path):
    problem = load(tmp_path)
    study = pz.Study(
        problem, [0.0, 60.0], ["ekf"], runs=1, vary={"truth.earth.degree": [4, 8], "truth.earth.gradient_degree": [2]}
    )
    world, assumed = study.problems(1)
    assert true_problem(world).functions["field"].degree == 8
    assert true_problem(world).functions["field"].gradient_degree == 2
    assert assumed.functions["field"].degree == 4
    with pytest.raises(ValueError, match="degree 500 is asked for of EGM2008"):
        pz.Study(problem, [0.0, 60.0], ["ekf"], vary={"truth.earth.degree": [500]})


@pytest.mark.parametrize("eop", ["{ ut1_utc = 0.1 }", '"subdaily"', "{ ut1_utc = 0.1, subdaily = true }"])
def test_a_problem_with_forces_is_kept_bit_for_bit(tmp_path, eop):
    problem = load(
        tmp_path,
        f'drag = "exponential"\neop = {eop}',
        "cd_a_m = 0.01",
        '[truth.earth]\ndegree = 10\nbodies = ["sun"]\n[truth.parameters]\ncd_a_m = 0.02',
    )
    tracking = pz.simulate(problem, [0.0, 60.0], np.random.default_rng(1))
    from piazzi.io import save

    save(tmp_path / "kept.nc", problem, tracking)
    again, _ = pz.load(tmp_path / "kept.nc")
    assert again.model == problem.model
    assert again.checksums == problem.checksums
    assert true_problem(again).model == true_problem(problem).model
    np.testing.assert_array_equal(rates(true_problem(again)), rates(true_problem(problem)))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"earth": "degre = 4"}, "earth.degre: unknown key; did you mean 'degree'"),
        ({"earth": 'bodies = ["son"]'}, "earth: bodies has 'son'.*did you mean 'sun'"),
        ({"earth": 'kernel = "nowhere.bsp"'}, "earth.kernel: .*nowhere.bsp: No such file"),
        ({"earth": 'gravity = "nowhere.gfc"'}, "earth: gravity model .*nowhere.gfc.*neither in the package"),
        ({"earth": "eop = { ut1 = 1.0 }"}, "earth.eop: eop: 'ut1' is not known; did you mean 'ut1_utc'"),
        ({"earth": 'radiation = "cannonball"'}, r"parameters.cr_a_m: is missing: a force of \[earth\] needs it, in m\^2/kg"),
        ({"earth": 'air_height = "high"'}, "earth.air_height: air_height is 'high'; it must be a number"),
        ({"more": '[dynamics]\nvx = "thurst"'}, "dynamics.vx: .*unknown name 'thurst'"),
        ({"more": "[truth.earth]\ndegree = 500"}, "truth.earth: degree 500 is asked for of EGM2008"),
        ({"more": '[truth.earth]\ndrag = "exponential"'}, "truth.parameters.cd_a_m: is missing"),
        ({"more": '[truth.definitions]\ndensity = "1"'}, "truth: definition 'density' is used by no equation"),
        ({"more": "[truth.parameters]\nnothing = 1.0"}, "truth.parameters.nothing: is no parameter"),
        ({"more": "[truth.stations.nowhere]\nx = 1.0"}, "truth.stations.nowhere: is no station"),
        ({"more": '[step]\nvx = "1"'}, r"earth: stands beside \[step\]"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path, given, message):
    with pytest.raises(ScenarioError, match=message):
        load(tmp_path, **given)


def test_forces_need_a_date(tmp_path):
    with pytest.raises(ScenarioError, match="earth: needs dates"):
        load(tmp_path, text=FILE.replace('epoch = "2016-02-13T16:00:00 UTC"', ""))


def test_a_date_without_a_scale_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"epoch: .*scale"):
        load(tmp_path, text=FILE.replace(" UTC", ""))


def test_a_state_inside_the_earth_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"prior: is 6,301 km from the centre of the Earth, which is below its surface"):
        load(tmp_path, text=FILE.replace("7000e3", "6300e3"))
