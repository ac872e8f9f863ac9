"""Small problems run the kernels' own source uncompiled."""

import pytest


@pytest.fixture
def uncompiled(monkeypatch):
    """The same generated source on NumPy arrays: nothing is compiled."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
