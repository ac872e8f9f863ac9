"""Laws over many sizes run the kernels' own source uncompiled."""

import pytest


@pytest.fixture(scope="class")
def uncompiled():
    """The same generated source on NumPy arrays: nothing is compiled."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        yield
