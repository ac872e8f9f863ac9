"""Two-line elements: numbers of objects beyond 99999, whose first digits are a letter."""

import pytest

import piazzi as pz

LINES = (
    "1 {}U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  292",
    "2 {}  51.6416 247.4627 0006703 130.5360 325.0288 15.7212539156353",
)


def tle(tmp_path, number):
    """Elements of an object of that number, with their checksums: digits, and one for each minus sign."""
    lines = [line.format(number) for line in LINES]
    sums = [sum(int(c) if c.isdigit() else c == "-" for c in line) % 10 for line in lines]
    path = tmp_path / "a.tle"
    path.write_text("".join(f"{line}{total}\n" for line, total in zip(lines, sums, strict=True)))
    return path


@pytest.mark.parametrize(
    "text, number",
    [
        ("25544", "25544"),
        ("A0000", "100000"),
        ("E8493", "148493"),
        ("J2931", "182931"),
        ("P4018", "234018"),
        ("Z9999", "339999"),
    ],
)
def test_numbers_of_objects(tmp_path, text, number):
    (mean,) = pz.read_ephemeris(tle(tmp_path, text)).mean
    assert dict(mean.said)["NORAD_CAT_ID"] == number


@pytest.mark.parametrize("text", ["I0000", "O1234", "AB123", "1 234"])
def test_what_is_no_number(tmp_path, text):
    with pytest.raises(ValueError, match=r"line 1: the object is|no format that is known"):
        pz.read_ephemeris(tle(tmp_path, text))
