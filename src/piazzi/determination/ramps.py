"""Fragments of functions that change at instants, over a ramp about each: values by parts of the time, profiles of engines."""

from __future__ import annotations

RAMP = 1e-3  # s


def pieces(count: int) -> str:
    """A function that has one of its arguments for each part of the time; ramps between them."""
    names = ", ".join(f"c{k}" for k in range(1, count + 1))
    ramps = [f"    s{k} = min(max((t - data[at + {k - 1}])*{1.0 / RAMP!r} + 0.5, 0.0), 1.0)" for k in range(1, count)]
    value = " + ".join(["c1", *(f"(c{k + 1} - c{k})*s{k}" for k in range(1, count))])
    partials = ["1.0 - s1", *(f"s{k - 1} - s{k}" for k in range(2, count)), f"s{count - 1}"]
    return "\n".join([
        f"def pieces(t, {names}, data, at):", *ramps, f"    return {value}",
        f"def pieces_partials(t, {names}, data, at):", *ramps, f"    return {', '.join([value, *partials])}",
    ]) + "\n"  # fmt: skip


def profiles(count: int) -> str:
    """A function with one value for each manoeuvre: one over its seconds while its engine is on."""
    lines = []
    for k in range(count):
        on, off = f"data[at + {2 * k}]", f"data[at + {2 * k + 1}]"
        ramp = "min(max((t - {})*" + f"{1.0 / RAMP!r}" + " + 0.5, 0.0), 1.0)"
        lines.append(f"    p{k} = ({ramp.format(on)} - {ramp.format(off)})/({off} - {on})")
    result = f"    return {', '.join(f'p{k}' for k in range(count))}"
    return "\n".join([
        "def profiles(t, data, at):", *lines, result, "def profiles_partials(t, data, at):", *lines, result,
    ]) + "\n"  # fmt: skip
