"""TOML that is written is read back to the same values, in the same order."""

import math
import tomllib

import numpy as np
import pytest

from piazzi.scenarios.toml_text import toml_text


def test_values_keep_all_bits_and_keys_their_order():
    rng = np.random.default_rng(0)
    table = {
        "text": 'a "b" \\ \n\t é \x7f \x01', "number": 0.1 + 0.2, "small": 5e-324, "whole": -3, "flag": True, "not bare": "x",
        "list": rng.standard_normal(50).tolist(), "nested": [[1.0, 2.0], [3.0, 4.0]], "empty": [], "none": {},
        "functions": {"short": {"kind": "a"}, "long": {"values": rng.standard_normal(40).tolist()}, "last": {"kind": "c"}},
        "stations": [{"name": "one", "place": {"of": [{"x": 1.0}, {"x": 2.0}]}}, {"name": "two", "numbers": {"a.b": 1e300}}],
        "sensors": {"range": {"components": {"range": {"equation": "x", "unit": "m"}}, "definitions": {"a, b": "f(x)"}}},
    }  # fmt: skip
    found = tomllib.loads(toml_text(table, ("a comment\nof two lines",)))
    assert found == table
    assert list(found["functions"]) == list(table["functions"])
    assert math.isinf(tomllib.loads(toml_text({"x": math.inf}))["x"])
    assert tomllib.loads(toml_text({"x": None, "y": 1})) == {"y": 1}


def test_what_toml_has_no_form_of_is_refused():
    with pytest.raises(ValueError, match="no form of object"):
        toml_text({"x": object()})
