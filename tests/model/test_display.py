"""`model.show()`: state, parameters, dynamics, F, h and H, as text in a terminal and as LaTeX in a notebook."""

import sys
import types

import pytest

import piazzi as pz
from piazzi.model.display import latex, sections

MODEL = pz.Model(
    ["x", "v"],
    ["v", "-k*sin(x)"],
    [
        pz.Sensor("range_rate", {"range": "sqrt((x - place)**2)", "rate": "v"}),
        pz.Sensor("angle", ["atan2(x, v)"], angles=["angle"]),
    ],
    {"k": "fixed", "c": "estimated"},
)


def test_sections_are_derived():
    titles = [title for title, _ in sections(MODEL)]
    assert titles[:4] == ["state x", "parameters p", "dx/dt = f", "F = df/dx"]
    assert titles[4:] == [
        "numbers of range_rate",
        "h of range_rate",
        "H = dh/dx of range_rate",
        "h of angle",
        "H = dh/dx of angle",
    ]
    matrices = dict(sections(MODEL))
    assert matrices["F = df/dx"].shape == (2, 3)
    assert matrices["H = dh/dx of range_rate"].shape == (2, 3)


def test_terminal_shows_every_formula(capsys):
    MODEL.show()
    out = capsys.readouterr().out
    for part in (
        "F = df/dx",
        "h of range_rate",
        "H = dh/dx of angle",
        "-k⋅sin(x)",
        "-k⋅cos(x)",
        "k: fixed, c: estimated",
        "atan2(x, v)",
    ):
        assert part in out, part


def test_discrete_models_show_the_step(capsys):
    pz.Model(["x"], ["x + dt*x**2"], discrete=True).show()
    out = capsys.readouterr().out
    assert "x[k+1]" in out
    assert "Phi = dx[k+1]/dx" in out
    assert "2⋅dt⋅x + 1" in out


def test_long_rows_are_not_wrapped(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    wide = pz.Model(
        [f"x{i}" for i in range(6)], [" + ".join(f"a{i}*x{i}**2" for i in range(6))] * 6, parameters=[f"a{i}" for i in range(6)]
    )
    wide.show()
    rows = [line for line in capsys.readouterr().out.splitlines() if "x₀" in line or "a₀" in line]
    assert rows
    assert all(line.count("⎡") + line.count("⎢") + line.count("⎣") <= 1 for line in rows)


def test_latex_is_balanced():
    text = latex(MODEL)
    assert text.startswith("$$") and text.endswith("$$")
    assert text.count(r"\begin{") == text.count(r"\end{")
    assert text.count("{") == text.count("}")
    assert r"\sin{\left(x \right)}" in text
    assert r"\text{numbers of range\_rate}" in text
    assert text.count("&=") == len(sections(MODEL))


def test_notebook_gets_latex(monkeypatch):
    shown = []
    ipython, display = types.ModuleType("IPython"), types.ModuleType("IPython.display")
    ipython.get_ipython = lambda: types.SimpleNamespace(config={"IPKernelApp": {}})
    display.Math = lambda text: ("math", text)
    display.display = shown.append
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    MODEL.show()
    assert shown == [("math", latex(MODEL).strip("$"))]


def test_ipython_in_a_terminal_gets_text(monkeypatch, capsys):
    ipython = types.ModuleType("IPython")
    ipython.get_ipython = lambda: types.SimpleNamespace(config={})
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    MODEL.show()
    assert "F = df/dx" in capsys.readouterr().out


@pytest.mark.parametrize(("name", "written"), [("alpha", r"\alpha"), ("x_1", "x_{1}"), ("beta_dot", r"\beta_{dot}")])
def test_latex_of_names(name, written):
    """A Greek letter is one, and what follows an underscore is an index: in the state, its rate and its derivative."""
    text = latex(pz.Model([name], [f"-3*{name}"]))
    assert f"- 3 {written}" in text
    assert name not in text.replace(written, "")
