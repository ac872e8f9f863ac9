"""Source of the functions from outside that a model calls, by their signatures; their data come in the block `p.data`."""

from __future__ import annotations

from piazzi.kernels.tables import table_source
from piazzi.model import Model


def outside_fragments(model: Model) -> tuple[str, ...]:
    """Names of the package's fragments that the functions need."""
    return tuple(dict.fromkeys(s.fragment for s in model.signatures if not s.terms and not s.code))


def outside_source(model: Model) -> str:
    """Source of tables, and of the user's own fragments."""
    tables = {(9 if s.kind == "rotation" else s.outputs, s.terms): None for s in model.signatures if s.terms}
    own = dict.fromkeys(s.code for s in model.signatures if s.code)
    return "".join(table_source(columns, terms) for columns, terms in tables) + "".join(f"{code}\n\n\n" for code in own)
