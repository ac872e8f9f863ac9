"""XML of messages as a stream of elements with their lines.  Document types and entities are refused before they are read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple
from xml.parsers import expat

from piazzi.formats.ndm import Source
from piazzi.text import one_line

DEEPEST = 40


class Element(NamedTuple):
    """An element that has ended: its name, attributes, text, and the line where it began."""

    name: str
    attributes: dict[str, str]
    text: str
    line: int


def walk(
    source: Source,
    data: bytes,
    begins: Callable[[str, dict[str, str], int], None],
    ends: Callable[[Element], None],
) -> None:
    """Call `begins` and `ends` for every element of a document, in its order; names without prefixes.

    Raises
    ------
    ValueError
        With file, line and reason, for what is no XML, or has a document type (and so may name other files or entities).
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)
    waiting: list[tuple[str, dict[str, str], int]] = []
    texts: list[str] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        if len(waiting) >= DEEPEST:
            source.refuse(parser.CurrentLineNumber, f"elements lie more than {DEEPEST} deep in one another")
        texts.clear()
        waiting.append((name.rpartition(":")[2], attributes, parser.CurrentLineNumber))
        begins(*waiting[-1])

    def end(_: str) -> None:
        name, attributes, line = waiting.pop()
        ends(Element(name, attributes, "".join(texts).strip(), line))
        texts.clear()

    def doctype(*_: Any) -> None:
        source.refuse(parser.CurrentLineNumber, "the file has a DOCTYPE, which may name other files; it is not read")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = texts.append
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        source.refuse(error.lineno, f"the file is no whole XML: {one_line(expat.ErrorString(error.code), 80)}")
    except (ValueError, LookupError) as error:
        if str(error).startswith(f"{source.name}: line "):
            raise
        source.refuse(1, f"the file is no XML that can be read: {one_line(str(error), 80)}")  # an encoding that expat has not
