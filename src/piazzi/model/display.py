"""A model as its author would write it on paper."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from piazzi.expressions import names, symbol, to_sympy
from piazzi.model.chain import Equations
from piazzi.model.definitions import Definition
from piazzi.model.derivation import derive, derive_events, derive_sensor
from piazzi.model.functions import AT, ROOT, STATION_TABLE
from piazzi.model.stages import AnyStage, Call, Stage

BY = "_by_"  # within the name of a symbol that stands for a derivative
Line = tuple[str, Any]  # what a value is called, and what it is


def sections(model: Equations) -> list[tuple[str, Any]]:
    """Titles and what is under them, lines or SymPy objects.

    State, parameters, functions from outside, definitions and their derivatives, dynamics and F, events, then of every sensor
    the same and h and H.  Derivatives are symbols in those that use them, as definitions are: see `plain`.
    """
    import sympy as sp

    d = derive(model, beside=False)
    name_of_f = "x[k+1]" if model.discrete else "dx/dt = f"
    out: list[tuple[str, Any]] = [("state x", sp.Matrix(d.x))]
    if model.parameters:
        out.append(("parameters p", sp.Matrix([sp.Symbol(p.name) for p in model.parameters])))
    if model.functions:
        out.append(("functions from outside", [(name, _form(signature)) for name, signature in model.functions]))
    seen: set[str] = set()
    out += _defined("definitions", model.definitions, d.partials, seen)
    out += [(name_of_f, plain(d.f)), ("Phi = dx[k+1]/dx" if model.discrete else "F = df/dx", plain(d.F))]
    if model.events:
        e = derive_events(model)
        out += _defined("events", (), e.partials, seen)
        out += [(f"events g: {', '.join(name for name, _ in model.events)}", plain(e.g)), ("dg/d(x, t)", plain(e.G))]
    for sensor in model.sensors:
        s = derive_sensor(model, sensor)
        own = [symbol for symbol in s.own if symbol.name != STATION_TABLE]
        if own:
            out.append((f"numbers of {sensor.name}", sp.Matrix(own)))
        out += _defined(f"definitions of {sensor.name}", sensor.definitions, s.partials, seen)
        out += [(f"h of {sensor.name}", plain(s.h)), (f"H = dh/dx of {sensor.name}", plain(s.H))]
    return out


def plain(value: Any) -> Any:
    """The same with ordinary symbols, a derivative's written with ∂."""
    import sympy as sp

    return value.xreplace({s: sp.Symbol(_shown(s.name), real=True) for s in value.free_symbols if isinstance(s, sp.Dummy)})


def _shown(name: str) -> str:
    value, by, x = name.rpartition(BY)
    return f"∂{value}/∂{x if x.isidentifier() else f'({x})'}" if by else name


def _form(signature: Any) -> str:
    """A function in a few words."""
    takes, gives = signature.arguments, signature.outputs
    return f"{signature.kind}, {takes} argument{'s' * (takes > 1)}, {gives} value{'s' * (gives > 1)}"


def _defined(
    title: str, definitions: Sequence[Definition], stages: Iterable[AnyStage], seen: set[str]
) -> list[tuple[str, Any]]:
    """Sections of definitions as they are said, and of their derivatives that are not `seen` yet."""
    out: list[tuple[str, Any]] = []
    if definitions:
        out.append((title, [line for d in definitions for line in _said(d)]))
    derived = [line for line in _derived(stages) if line[0] not in seen]
    seen.update(name for name, _ in derived)
    return [*out, (f"derivatives of {title}", derived)] if derived else out


def _said(d: Definition) -> Iterator[Line]:
    """Lines of a definition; a root's own ones come before it."""
    import sympy as sp

    def read(text: str) -> Any:
        return to_sympy(text, {name: symbol(name) for name in names(text)})

    left = ", ".join(d.names)
    if d.function == ROOT:
        for inner in d.inner:
            yield from _said(inner)
        yield left, sp.Eq(read(d.texts[0]), 0, evaluate=False)
    elif d.function == AT and len(d.texts) > 1:
        yield left, sp.Function("at")(read(d.texts[0]), sp.Symbol(f"order={d.texts[1]}"))
    elif d.function:
        yield left, sp.Function(d.function)(*map(read, d.texts))
    else:
        yield left, read(d.texts[0])


def _derived(stages: Iterable[AnyStage]) -> Iterator[Line]:
    """Lines of derivatives; those that a function from outside knows are only said to be known."""
    for stage in stages:
        if isinstance(stage, Call):
            known = [_shown(s.name) for s in stage.symbols if BY in s.name]
            if known:
                yield ", ".join(known), f"given by {stage.function.removesuffix('_partials')}"
        elif isinstance(stage, Stage):
            for s, value in zip(stage.symbols, stage.values, strict=True):
                if BY in s.name and s.is_Dummy:
                    yield _shown(s.name), plain(value)


def latex(model: Equations) -> str:
    """The sections as one LaTeX display."""
    rows = []
    for title, value in sections(model):
        label = rf"\text{{{title.replace('_', chr(92) + '_')}}}"
        if isinstance(value, list):
            rows += [f"{label} &:", *(f"{_name(left)} &= {_in_latex(right)}" for left, right in value)]
        else:
            rows.append(f"{label} &= {_in_latex(value)}")
    return r"$$\begin{aligned}" + r"\\[4pt] ".join(rows) + r"\end{aligned}$$"


def _name(text: str) -> str:
    """Names with commas, and derivatives, in LaTeX."""
    import sympy as sp

    def one(name: str) -> str:
        if not name.startswith("∂"):
            return str(sp.latex(sp.Symbol(name)))
        value, _, x = name[1:].partition("/∂")
        below = one(x) if x.isidentifier() else rf"\left({x.strip('()')}\right)"
        return rf"\frac{{\partial {one(value)}}}{{\partial {below}}}"

    return ", ".join(map(one, text.split(", ")))


def _in_latex(value: Any) -> str:
    import sympy as sp

    if isinstance(value, str):
        return rf"\text{{{value.replace('_', chr(92) + '_')}}}"
    return str(sp.latex(value, symbol_names={s: _name(s.name) for s in value.free_symbols if s.name.startswith("∂")}))


def rich_text(model: Equations) -> Any:
    """The sections as a rich group of titled formulas: lines, and two-dimensional ones."""
    import sympy as sp
    from rich.console import Group
    from rich.text import Text

    parts: list[Any] = []
    for title, value in sections(model):
        role = {p.name: p.role for p in model.parameters}
        note = "  (" + ", ".join(f"{k}: {r}" for k, r in role.items()) + ")" if title.startswith("parameters") else ""
        parts.append(Text(title + note, style="bold cyan"))
        if isinstance(value, list):
            parts += [Text(f"  {left}{_equals(right)}") for left, right in value]
        else:
            parts.append(Text(sp.pretty(value, use_unicode=True, wrap_line=False)))
        parts.append(Text(""))
    return Group(*parts)


def _equals(right: Any) -> str:
    """What a value is, as a line's end."""
    import sympy as sp

    if isinstance(right, str):
        return f": {right}"
    return f" solves {right.lhs} = 0" if isinstance(right, sp.Eq) else f" = {right}"


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
