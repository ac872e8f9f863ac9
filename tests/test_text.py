"""Words of messages: one printable line, and the name that was probably meant."""

import pytest

from piazzi.text import nearest, one_line, printable, suggest


def test_what_would_steer_a_terminal_is_written_out():
    assert printable("a\x1b[31m\n\u202eb") == r"a\x1b[31m\n\u202eb"
    assert printable("naïve θ") == "naïve θ"
    assert one_line("x\n" * 400, 6) == r"x\nx\nx\n ..."


@pytest.mark.parametrize(
    ("name", "valid", "hint"),
    [
        ("rnge", ["bearing", "range"], "; did you mean 'range'?"),
        ("MU", ["mu", "r0"], "; did you mean 'mu'?"),
        ("Vx", ["VX", "vx"], "; did you mean 'vx'?"),
        ("q", ["bearing"], "; known: bearing"),
        ("q", [], ""),
    ],
)
def test_the_nearest_name_is_offered_or_all_of_them(name, valid, hint):
    assert nearest(name, valid) == hint
    assert suggest(name, valid) == (hint if "mean" in hint else "")
