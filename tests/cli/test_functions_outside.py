"""Functions from outside that cannot be, through the command line: one line that names the place, and exit 2."""

import numpy as np
import pytest

SCENARIO = """
states = ["x", "y", "z", "vx", "vy", "vz"]
epoch = "2016-02-13T16:00:00 UTC"
[functions]
field = {field}
push = {push}
[definitions]
"gx, gy, gz" = "{call}"
a = "push({time})"
[dynamics]
x = "vx"
y = "vy"
z = "vz"
vx = "gx + a"
vy = "gy"
vz = "gz"
[sensors.s.components]
seen = "x"
[[stations]]
name = "s"
sensor = "s"
noise = {{ sigma = 1.0 }}
[prior]
mean = [7e6, 0, 0, 0, 5.3e3, 5.3e3]
sigma = [10, 10, 10, 0.1, 0.1, 0.1]
[times]
step = 10.0
count = 5
start = {start}
"""
USUAL = {
    "field": '{ kind = "gravity", model = "field.gfc" }',
    "push": '{ kind = "table", file = "push.csv" }',
    "call": "field(x, y, z)",
    "time": "t",
    "start": "0.0",
}
HEAD = """product_type gravity_field
modelname small
earth_gravity_constant 0.3986004415E+15
radius 0.63781363E+07
max_degree 2
norm fully_normalized
tide_system tide_free
errors no
end_of_head ===
"""
ROWS = ["gfc 0 0 1.0 0.0", "gfc 2 0 -0.484165e-03 0.0", "gfc 2 1 -0.2e-09 0.14e-08", "gfc 2 2 0.243e-05 -0.14e-05"]
GFC = HEAD + "\n".join(ROWS) + "\n"


@pytest.fixture
def simulate(call, tmp_path, monkeypatch):
    """Simulate a scenario with other entries, and other files beside it; uncompiled."""
    monkeypatch.setenv("PIAZZI_JIT", "0")

    def run(gfc=GFC, csv=None, text=SCENARIO, **changes):
        t = np.arange(-100.0, 200.0, 10.0)
        usual = "".join(f"{a},{b}\n" for a, b in zip(t, 1e-6 * np.sin(t / 50.0), strict=True))
        (tmp_path / "field.gfc").write_text(gfc)
        (tmp_path / "push.csv").write_text(usual if csv is None else csv)
        (tmp_path / "s.toml").write_text(text.format(**(USUAL | changes)))
        return call("simulate", tmp_path / "s.toml", "-o", tmp_path / "out.csv")

    return run


def test_the_usual_one_runs(simulate):
    assert simulate().status == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"push": '{ kind = "tabel", file = "push.csv" }'}, "push.kind: is 'tabel', which is no kind of function; did"),
        ({"push": '{ file = "push.csv" }'}, "functions.push.kind: is missing"),
        ({"push": '{ kind = "table", file = "posh.csv" }'}, "posh.csv"),
        ({"field": '{ kind = "gravity", model = "feld.gfc" }'}, "feld.gfc"),
        ({"field": '{ kind = "gravity", model = "EGM1866" }'}, "EGM1866"),
        ({"push": '{ kind = "table", file = "push.csv", fragment = "own.py" }'}, "functions.push.fragment"),
        ({"push": '{ kind = "function", fragment = "own.py" }'}, "is 'function', which is no kind of function"),
        ({"push": '{ kind = "table", file = "s.toml" }'}, "s.toml, line 2"),
        ({"call": "field(x, y)"}, "field takes 3 arguments, got 2"),
        ({"time": "t, x"}, "push takes 1 argument, got 2"),
        ({"text": SCENARIO.replace('"gx, gy, gz" =', '"gx, gy, gz, gw" =')}, "field(x, y, z) gives 3 values, not 4"),
        ({"text": SCENARIO.replace('a = "push', '"a, b" = "push')}, "gives 1 values, not 2"),
        ({"start": "180.0"}, "'push' has values from t = -100 to 190 s, and t = 220 s is outside"),
        ({"field": '{ kind = "gravity", model = "field.gfc", degree = 3 }'}, "degree 3 is asked for of small (field.gfc)"),
        ({"field": '{ kind = "gravity", degree = 121 }'}, "degree 121 is asked for of EGM2008"),
        ({"gfc": GFC.replace("0.14e-08", "nan")}, "field.gfc, line 12"),
        ({"gfc": GFC.replace(ROWS[3], "gfc 2 2 0.243e-05")}, "field.gfc, line 13"),
        ({"gfc": GFC[:-20]}, "field.gfc, line 13"),
        ({"csv": "0,1\n1,nan\n"}, "push.csv, line 2: values must be finite"),
        ({"csv": "0,1\n1\n"}, "push.csv, line 2: 1 values, where the rows before have 2"),
        ({"csv": "1,1\n0,2\n"}, "times of a table must ascend; row 1 is 0 after 1"),
        ({"text": SCENARIO.replace("field =", "sqrt =")}, "'sqrt' cannot be used as a name: it is one of the language"),
        ({"text": SCENARIO.replace("field =", "at ="), "call": "at(x, y, z)"}, "function 'at' has a meaning already"),
        ({"text": SCENARIO.replace("field =", "x ="), "call": "x(x, y, z)"}, "function 'x' is also a state"),
        ({"text": SCENARIO.replace('a = "push', 'push = "push').replace("+ a", "+ push")}, "'push' is also a definition"),
        ({"text": SCENARIO.replace('a = "push', 'sin = "push').replace("+ a", "+ sin")}, "'sin'"),
        ({"text": SCENARIO.replace('a = "push', 'b = "a"\na = "push')}, "definition 'b' is used by no equation"),
        ({"text": SCENARIO.replace('"push({time})"', '"b"\nb = "a"')}, "definitions: 'a' and 'b' need each other"),
        ({"push": '{ kind = "interpolation", x = [0, 1], values = [1, 2, 3] }'}, "values of an interpolation have shape (3,)"),
        ({"push": '{ kind = "interpolation", x = [0, 1], values = ["a", 2] }'}, "must be made of numbers"),
        ({"push": '{ kind = "interpolation", x = [0, 30], values = [1, 2] }'}, "has values from t = 0 to 30 s, and t = 40 s"),
        ({"push": '{ kind = "interpolation", x = [0, 30], values = [1, 2], outside = "hold" }'}, "outside is 'hold'"),
        ({"push": '{ kind = "interpolation" }'}, "functions.push: has no nodes"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(simulate, changes, message):
    assert message in simulate(**changes).refused()
