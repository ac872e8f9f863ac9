"""What a study of a scenario does unless told otherwise."""

from __future__ import annotations

from piazzi.scenarios.faults import shown
from piazzi.scenarios.scenario import Plan
from piazzi.scenarios.table import Table, number
from piazzi.scenarios.truth import read_texts


def read_plan(table: Table) -> Plan:
    """The section [study]: runs, estimators, and what is varied."""
    runs, estimators = table.whole("runs"), read_texts(table, "estimators")
    inner = table.table("vary")
    vary = {name: _values(inner, name) for name in inner.data}
    table.finish()
    return Plan(runs, estimators, {name: values for name, values in vary.items() if values})


def _values(table: Table, key: str) -> tuple[str, ...]:
    """A list of numbers or texts, as text."""
    value = table.raw(key)
    items = value if isinstance(value, list) else [value]
    if not items or any(number(item) is None and not isinstance(item, str) for item in items):
        table.fault(key, f"must be a list of numbers or texts, not {shown(value)}")
        return ()
    return tuple(item if isinstance(item, str) else repr(item) for item in items)
