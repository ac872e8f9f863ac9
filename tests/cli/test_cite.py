"""``piazzi cite``: BibTeX that can be read."""

import re

import piazzi as pz


def test_entries_are_whole(call):
    text = call("cite").out
    entries = re.findall(r"^@(\w+)\{(\w+),$", text, re.MULTILINE)
    assert entries[0] == ("software", "piazzi") and len({key for _, key in entries}) == len(entries) >= 3
    assert text.count("{") == text.count("}")
    assert f"version = {{{pz.__version__}}}" in text
