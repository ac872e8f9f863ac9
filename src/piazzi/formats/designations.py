"""Designations of minor planets, comets and satellites, and the twelve packed characters of the Minor Planet Center.

Source: Packed Provisional and Permanent Designations, Minor Planet Center, with the extensions beyond 619999 and cycle 619.
"""

from __future__ import annotations

import re
from string import ascii_lowercase, ascii_uppercase, digits

_DIGITS = digits + ascii_uppercase + ascii_lowercase  # of base 62
_ORDER = "ABCDEFGHJKLMNOPQRSTUVWXYZ"  # of the second letter of a half month: I is not used
_CENTURIES = {"I": 18, "J": 19, "K": 20, "L": 21}
_PLANETS = {"M": "Mars", "J": "Jupiter", "S": "Saturn", "U": "Uranus", "N": "Neptune", "P": "Pluto", "E": "Earth"}
_PROVISIONAL = re.compile(r"([IJKL])(\d\d)([A-HJ-Y])([0-9A-Za-z])(\d)([0-9A-Za-z])")
_SURVEY = re.compile(r"(PL|T1|T2|T3)S(\d{4})")
_EXTENDED = re.compile(r"_([0-9A-Za-z])([A-HJ-Y])([0-9A-Za-z]{4})")
_MINOR = re.compile(r"(A\d{3}|1[89]\d\d|2[01]\d\d) ([A-HJ-Y])([A-HJ-Z])(\d*)")
_COMET = re.compile(r"([CPDXAI])/(1[89]\d\d|2[01]\d\d) ([A-HJ-Y])(\d{1,3})(?:-([A-Z]))?")
_CYCLES = 620  # from here on designations are extended


def _base62(text: str) -> int:
    value = 0
    for letter in text:
        value = 62 * value + _DIGITS.index(letter)
    return value


def _to_base62(value: int) -> str:
    out = ""
    for _ in range(4):
        value, digit = divmod(value, 62)
        out = _DIGITS[digit] + out
    return out


def unpack(packed: str) -> str:
    """Designation of the first twelve columns: ``(1)``, ``1995 XA``, ``C/2020 F3``, ``73P-B``, ``Jupiter 13``, ``S/2004 S 1``.

    What is packed by no rule, such as an observer's own name of an object, comes back as it is.
    """
    packed = packed.ljust(12)[:12]
    number, provisional = packed[:5], packed[5:]
    kind = number[4]
    if re.fullmatch(r"\d{4}[PD]", number):
        fragment = provisional.strip()
        return f"{int(number[:4])}{kind}" + (f"-{fragment.upper()}" if re.fullmatch(r"[a-z]{1,2}", fragment) else "")
    if re.fullmatch(r"[A-Z]\d{3}S", number) and number[0] in _PLANETS:
        return f"{_PLANETS[number[0]]} {int(number[1:4])}"
    if re.fullmatch(r"[0-9A-Za-z]\d{4}", number):
        return f"({_DIGITS.index(number[0]) * 10000 + int(number[1:])})"
    if re.fullmatch(r"~[0-9A-Za-z]{4}", number):
        return f"({620000 + _base62(number[1:])})"
    found = _unpack_provisional(provisional, kind) if not number[:4].strip() else None
    return found or packed.strip()


def _unpack_provisional(text: str, kind: str) -> str | None:
    if kind == " " and (survey := _SURVEY.fullmatch(text)):
        return f"{survey[2]} {survey[1][0]}-{survey[1][1]}"
    if kind == " " and (extended := _EXTENDED.fullmatch(text)):
        cycle, letter = divmod(_base62(extended[3]) + _CYCLES * 25, 25)
        return f"20{_DIGITS.index(extended[1]):02d} {extended[2]}{_ORDER[letter]}{cycle}"
    found = _PROVISIONAL.fullmatch(text)
    if not found:
        return None
    year = f"{_CENTURIES[found[1]]}{found[2]}"
    count = _DIGITS.index(found[4]) * 10 + int(found[5])
    if kind == "S":
        return f"S/{year} {found[3]} {count}" if found[6] == "0" else None
    if kind in "CPDXAI":
        if found[6] == "0" or found[6].islower():
            return f"{kind}/{year} {found[3]}{count}" + (f"-{found[6].upper()}" if found[6] != "0" else "")
        year = f"{kind}/{year}"
    elif kind != " ":
        return None
    return f"{year} {found[3]}{found[6]}{count or ''}" if found[6] in _ORDER else None


def pack(name: str) -> str:
    """The twelve columns of a designation; raises ValueError for one that no rule packs."""
    if match := re.fullmatch(r"\((\d+)\)", name):
        number = int(match[1])
        if number < 620000:
            return f"{_DIGITS[number // 10000]}{number % 10000:04d}".ljust(12)
        if number - 620000 < 62**4:
            return f"~{_to_base62(number - 620000)}".ljust(12)
    if match := re.fullmatch(r"(\d{1,4})([PD])(?:-([A-Z]{1,2}))?", name):
        return f"{int(match[1]):04d}{match[2]}" + (match[3] or "").lower().rjust(7)
    if match := re.fullmatch(r"([A-Z][a-z]+) (\d{1,3})", name):
        letter = next((letter for letter, planet in _PLANETS.items() if planet == match[1]), None)
        if letter:
            return f"{letter}{int(match[2]):03d}S".ljust(12)
    if match := re.fullmatch(r"(\d{4}) ([PT])-([L123])", name):
        return f"     {match[2]}{match[3]}S{match[1]}"
    if match := re.fullmatch(r"S/(1[89]\d\d|2[01]\d\d) ([A-HJ-Y]) (\d{1,3})", name):
        return f"    S{_year(match[1])}{match[2]}{_count(int(match[3]))}0"
    if match := _COMET.fullmatch(name):
        return f"    {match[1]}{_year(match[2])}{match[3]}{_count(int(match[4]))}{(match[5] or '0').lower()}"
    kind, slash, rest = name.rpartition("/")
    if match := _MINOR.fullmatch(rest):
        count = int(match[4] or 0)
        if count < _CYCLES and (not slash or kind in "CPDXAI"):
            return f"    {kind or ' '}{_year(match[1])}{match[2]}{_count(count)}{match[3]}"
        if not slash and match[1][:2] == "20" and (count - _CYCLES) * 25 + _ORDER.index(match[3]) < 62**4:
            sequence = (count - _CYCLES) * 25 + _ORDER.index(match[3])
            return f"     _{_DIGITS[int(match[1][2:])]}{match[2]}{_to_base62(sequence)}"
    raise ValueError(f"designation {name[:40]!r} cannot be packed")


def _year(text: str) -> str:
    """Packed year; before 1925 years may be written as A904."""
    full = f"1{text[1:]}" if text[0] == "A" else text
    return next(letter for letter, century in _CENTURIES.items() if full[:2] == str(century)) + full[2:]


def _count(value: int) -> str:
    if value >= _CYCLES:
        raise ValueError(f"{value} is more than two packed characters hold")
    return f"{_DIGITS[value // 10]}{value % 10}"
