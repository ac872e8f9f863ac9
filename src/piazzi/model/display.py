"""A model as its author would write it on paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from piazzi.model.chain import Equations
from piazzi.model.derivation import derive, derive_sensor
from piazzi.model.stages import AnyStage, Call, Elsewhen, Solve, Stage


def sections(model: Equations) -> list[tuple[str, Any]]:
    """Titles and SymPy objects: state, parameters, dynamics and F, and h and H of every sensor."""
    import sympy as sp

    d = derive(model)
    name_of_f = "x[k+1]" if model.discrete else "dx/dt = f"
    out: list[tuple[str, Any]] = [("state x", sp.Matrix(d.x))]
    if model.parameters:
        out.append(("parameters p", sp.Matrix([sp.Symbol(p.name) for p in model.parameters])))
    out += _shown(d.partials)
    out += [(name_of_f, d.f), ("Phi = dx[k+1]/dx" if model.discrete else "F = df/dx", d.F)]
    for sensor in model.sensors:
        s = derive_sensor(model, sensor)
        if s.own:
            out.append((f"numbers of {sensor.name}", sp.Matrix(s.own)))
        out += _shown(s.partials, f" for {sensor.name}")
        out += [(f"h of {sensor.name}", s.h), (f"H = dh/dx of {sensor.name}", s.H)]
    return out


def _shown(stages: Sequence[AnyStage], what: str = "") -> list[tuple[str, Any]]:
    """Definitions with their derivatives."""
    import sympy as sp

    if not stages:
        return []
    rows = [[s, v] for stage in stages for s, v in _rows(stage)]
    return [(f"definitions and their derivatives{what}", sp.Matrix(rows))]


def _rows(stage: AnyStage) -> list[tuple[Any, Any]]:
    """What is defined together, and what it is."""
    import sympy as sp

    match stage:
        case Stage():
            return list(zip(stage.symbols, stage.values, strict=True))
        case Call():
            name, arguments = stage.function.removesuffix("_partials"), stage.arguments
        case Elsewhen():
            name, arguments = "at", (stage.offset,)
        case Solve():
            inner = [row for own in stage.inner for row in _rows(own)]
            return [*inner, (stage.symbols[0], sp.Function("root")(stage.residual, stage.unknown))]
    return [(s, sp.Function(f"{name}_{i}")(*arguments)) for i, s in enumerate(stage.symbols)]


def latex(model: Equations) -> str:
    """The sections as one LaTeX display."""
    import sympy as sp

    rows = [rf"\text{{{title.replace('_', chr(92) + '_')}}} &= {sp.latex(value)}" for title, value in sections(model)]
    return r"$$\begin{aligned}" + r"\\[4pt] ".join(rows) + r"\end{aligned}$$"


def rich_text(model: Equations) -> Any:
    """The sections as a rich group of titled, two-dimensional formulas."""
    import sympy as sp
    from rich.console import Group
    from rich.text import Text

    parts: list[Any] = []
    for title, value in sections(model):
        role = {p.name: p.role for p in model.parameters}
        note = "  (" + ", ".join(f"{k}: {r}" for k, r in role.items()) + ")" if title.startswith("parameters") else ""
        parts += [Text(title + note, style="bold cyan"), Text(sp.pretty(value, use_unicode=True, wrap_line=False)), Text("")]
    return Group(*parts)


def show(model: Equations) -> None:
    """Display the model where the caller is: LaTeX in a notebook, rich text in a terminal."""
    try:
        from IPython import get_ipython  # type: ignore[import-not-found,unused-ignore]

        notebook = get_ipython() is not None and "IPKernelApp" in get_ipython().config
    except ImportError:
        notebook = False
    if notebook:
        from IPython.display import Math, display  # type: ignore[import-not-found,unused-ignore]

        display(Math(latex(model).strip("$")))
        return
    from rich.console import Console

    Console().print(rich_text(model), soft_wrap=True)
