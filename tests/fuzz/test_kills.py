"""What is killed can be gone on from, with the same results; `python tests/fuzz/kills.py` kills 200 times."""

import sys

import pytest

from tests.fuzz.kills import KINDS, run

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are found as Linux shows them"),
]


@pytest.mark.parametrize("kind", KINDS)
def test_the_next_call_is_right_after_a_kill(kind):
    (tally,) = run((kind,), kills=3, seed=5)
    assert tally.kills == 3
    assert tally.wrong == []
    assert tally.left == []
