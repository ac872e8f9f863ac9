"""Source of tables over time: pieces of polynomials of equal length, so many columns of so many terms each.

The data of one begin with: its first instant, pieces per second, how many pieces, seconds of a piece, the position from here on
of the coefficients, its last instant.  Of each piece the coefficients are the terms, highest power first, each a row of all
columns (padded to a register), in tau = -1 to 1.  Outside of the table values are not numbers.
"""

from __future__ import annotations

from piazzi.model import Model

_LOOK_UP = """@outlined
def {name}_of_one(t, data, at):
    if not data[at] <= t <= data[at + 5]:
        return ({unknown},)
    past = t - data[at]
    piece = int(minimum(past * data[at + 1], data[at + 2] - 1.0))
    tau = 2.0 * (past - piece * data[at + 3]) * data[at + 1] - 1.0
    row = at + int(data[at + 4]) + piece * {size}
    u = load_vector(data, row, {width}){begin}
    for _ in range({terms} - 1):
        row += {width}
        {horner}
    return ({results},)


@inline
def {name}(t, data, at):
    return each_lane({name}_of_one, t, data, at)


"""


def padded(columns: int) -> int:
    """Numbers in a row of coefficients: as many as one or several registers hold."""
    return next((w for w in (1, 2, 4) if columns <= w), -(-columns // 8) * 8)


def table_source(columns: int, terms: int) -> str:
    """``table_CxT(t, data, at)``, the columns at `t`, and ``table_CxT_partials``, in which their rates follow."""
    name, width = f"table_{columns}x{terms}", padded(columns)
    sizes = {"width": width, "size": width * terms, "terms": terms}
    next_row = f"load_vector(data, row, {width})"
    values = [f"u[{i}]" for i in range(columns)]
    rates = [f"2.0 * data[at + 1] * v[{i}]" for i in range(columns)]
    value, partials = f"u = fused(tau, u, {next_row})", f"v, u = fused(tau, v, u), fused(tau, u, {next_row})"
    return "".join(
        _LOOK_UP.format(name=n, begin=b, horner=h, results=", ".join(r), unknown=", ".join(["nan"] * len(r)), **sizes)
        for n, b, h, r in (
            (name, "", value, values),
            (f"{name}_partials", "\n    v = 0.0 * u", partials, values + rates),
        )
    )


def outside_source(model: Model) -> str:
    """Source of tables, and of the user's own fragments."""
    tables = {(9 if s.kind == "rotation" else s.outputs, s.terms): None for s in model.signatures if s.terms}
    own = dict.fromkeys(s.code for s in model.signatures if s.code)
    return "".join(table_source(columns, terms) for columns, terms in tables) + "".join(f"{code}\n\n\n" for code in own)
