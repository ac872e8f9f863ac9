"""``piazzi simulate``, ``scenarios`` and ``demo``."""

import json

import numpy as np
import pytest

import piazzi as pz
from piazzi.scenarios import load_scenario, names, show

SCENARIO = "b612-range"


def test_simulate_writes_what_load_draws(call, tmp_path):
    _, tracking = pz.load(SCENARIO, seed=3)
    for ending in ("nc", "csv"):
        result = call("simulate", SCENARIO, "--seed", 3, "-o", tmp_path / f"t.{ending}")
        assert (result.status, result.out.splitlines()[-1]) == (0, f"Wrote {tmp_path / f't.{ending}'}")
        found = pz.load(tmp_path / f"t.{ending}", **({"scenario": SCENARIO} if ending == "csv" else {}))[1]
        assert (found.values == tracking.values).all()
        assert (found.truth == tracking.truth).all()


def test_simulate_tells_in_json_what_it_drew(call):
    document = call("simulate", SCENARIO, "--json").document
    truth = pz.load(SCENARIO)[1].truth
    assert (document["schema"], document["seed"], document["epochs"]) == ("piazzi.simulate/1", 0, 100)
    assert document["final"]["truth"] == truth[-1].tolist()
    assert document["output"] is None


def test_a_recording_is_simulated_anew_at_its_times(call, tmp_path):
    call("simulate", SCENARIO, "-o", tmp_path / "t.nc")
    one, two = (call("simulate", tmp_path / "t.nc", "--seed", s, "-o", tmp_path / f"{s}.nc").status for s in (5, 6))
    assert one == two == 0
    first, second, third = (pz.load(tmp_path / f"{s}.nc")[1] for s in ("t", 5, 6))
    assert (first.times == second.times).all()
    assert len({t.values.tobytes() for t in (first, second, third)}) == 3


def test_substeps_are_chosen_by_a_tolerance(call, tmp_path):
    """As few as that asks for; the problem is kept with them."""
    counts = []
    for tolerance in (1.0, 1e-6):
        result = call("simulate", SCENARIO, "--tolerance", tolerance, "-o", tmp_path / "t.nc", "--json")
        assert result.status == 0
        counts.append(pz.load(tmp_path / "t.nc")[0].integrator.substeps)
        assert f"substeps={counts[-1]}" in result.document["integrator"]
    assert 1 <= counts[0] < counts[1] < 100
    assert "tolerance is -1" in call("simulate", SCENARIO, "--tolerance", -1).refused()


def test_the_notebooks_options_of_simulation(call, tmp_path):
    """Noiseless, a perfect guess, a fixed or a drawn truth: each as asked for, and nothing else."""
    plain = pz.load(SCENARIO)[1]
    found = {}
    for flags in (["--noiseless"], ["--perfect-guess"], ["--truth", "drawn"], ["--truth", "fixed"]):
        assert call("simulate", SCENARIO, *flags, "-o", tmp_path / "t.nc").status == 0
        found[flags[-1]] = pz.load(tmp_path / "t.nc")
    problem, tracking = found["--noiseless"]
    assert (tracking.values == problem.measure("radar", tracking.truth, tracking.times)).all()
    problem, tracking = found["--perfect-guess"]
    assert problem.mean.tolist() == tracking.truth[0].tolist() == plain.truth[0].tolist()
    assert (found["drawn"][1].truth[0] != plain.truth[0]).all()
    assert (found["fixed"][1].values == plain.values).all()
    assert "'fixed', 'drawn'" in call("simulate", SCENARIO, "--truth", "free").refused()


def test_a_problem_that_a_format_cannot_hold_leaves_no_file(call, tmp_path):
    call("simulate", SCENARIO, "-o", tmp_path / "t.npz").refused()
    assert not list(tmp_path.iterdir())


def test_json_and_csv_do_not_share_stdout(call):
    assert "both want stdout" in call("simulate", SCENARIO, "-o", "-", "--json").refused()


def test_the_scenarios_are_listed(call):
    for arguments in (["scenarios"], ["scenarios", "list"]):
        lines = call(*arguments).out.splitlines()
        assert [line.split()[0] for line in lines] == names()
    found = call("scenarios", "list", "--json").document
    assert [s["name"] for s in found["scenarios"]] == names()


def test_equations_that_result_are_shown(call):
    text = call("scenarios", "show", "b612-range", "--equations").out
    model = load_scenario("b612-range").problem.model
    for state, rate in zip(model.states, model.dynamics, strict=True):
        assert f"d{state}/dt = {rate}" in text
    for left, equation in model.definitions:
        assert f"{left} = {equation}\n" in text
    assert "true instead" not in text


@pytest.mark.parametrize("name", [*names(), "template"])
def test_a_scenario_that_is_shown_can_be_used(call, tmp_path, name):
    text = call("scenarios", "show", name).out
    assert text == show(name)
    (tmp_path / "mine.toml").write_text(text)
    assert call("scenarios", "check", tmp_path / "mine.toml").out == f"{tmp_path / 'mine.toml'}: nothing wrong; prior at 0 s\n"


def test_all_faults_of_a_scenario_are_listed(call, tmp_path):
    text = show(SCENARIO).replace('method = "rk4"', 'method = "rk5"').replace("[prior]", "[priot]")
    (tmp_path / "bad.toml").write_text(text)
    result = call("scenarios", "check", tmp_path / "bad.toml")
    assert (result.status, result.out) == (2, "")
    assert len(result.said) >= 2
    assert "rk5" in result.err
    assert "priot" in result.err
    assert call("estimate", tmp_path / "bad.toml").refused()


def test_unknown_scenarios_are_refused(call):
    assert "did you mean 'b612-range'" in call("scenarios", "show", "b612-rang").refused()
    assert "nowhere.toml" in call("scenarios", "check", "nowhere.toml").refused()


@pytest.mark.slow  # a dozen kernels
def test_demo_writes_what_it_says(call, tmp_path):
    result = call("demo", "-o", tmp_path / "demo", "--title", "A first look")
    assert result.status == 0
    made = sorted(str(p.relative_to(tmp_path / "demo")) for p in (tmp_path / "demo").glob("*/*"))
    kinds = [
        "comparison.json",
        "comparison.png",
        "consistency.png",
        "errors.png",
        "measurements.png",
        "orbit.png",
        "tracking.csv",
    ]
    assert made == [f"{p}/{k}" for p in ("b612-range", "gps-position", "satellite-bearing") for k in kinds]
    assert "Wrote 22 files" in result.out
    assert f"Open {tmp_path / 'demo' / 'report.html'} in a browser" in result.out
    page = (tmp_path / "demo" / "report.html").read_text()
    assert page.startswith("<!DOCTYPE html>") and "<title>A first look</title>" in page
    for name in ("b612-range", "gps-position", "satellite-bearing"):
        document = json.loads((tmp_path / "demo" / name / "comparison.json").read_text())
        assert document["schema"] == "piazzi.compare/1"
        assert all(row["success"] for row in document["rows"])
        truth = pz.load(tmp_path / "demo" / name / "tracking.csv", scenario=name)[1].truth
        assert np.isfinite(truth).all()
    # every command that it says comes next
    for line in result.out.split("Next:")[1].splitlines():
        words = line.split()
        if words[:1] == ["piazzi"] and ">" not in words:
            assert call(*words[1:]).status == 0, line


def test_demo_refuses_a_folder_that_cannot_be(call, tmp_path):
    (tmp_path / "file").write_text("kept")
    call("demo", "-o", tmp_path / "file").refused()
    assert (tmp_path / "file").read_text() == "kept"
