"""Docstrings and signatures as they are meant.

A docstring says what a value is in words: only words that begin with a capital letter are names of classes to link to, and a
property's first line with a colon in it is a sentence.  A class takes more than the types of its attributes tell, so its
signature has names and defaults, and the docstring the rest.
"""

from __future__ import annotations

import inspect
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx


def words_stay_words(app: Sphinx, tree: nodes.document) -> None:
    """Unlink the "names" of "sequence of names", for which there are three attributes to choose from."""
    for field in tree.findall(nodes.field):
        for link in list(field.findall(addnodes.pending_xref)):
            if not link["reftarget"].rpartition(".")[2][:1].isupper():
                link.replace_self([part for child in link.children for part in _unresolved(child)])


def _unresolved(child: nodes.Node) -> list[nodes.Node]:
    """What stands for a link's part where nothing is linked."""
    if not isinstance(child, addnodes.pending_xref_condition):
        return [child]
    return child.children if child["condition"] == "*" else []


_sentences: dict[str, list[str]] = {}


def keep_sentence(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Remember the docstring of a property before it is taken apart."""
    if what in ("property", "attribute"):
        _sentences[name] = list(lines)


def restore_sentence(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Put it back."""
    if name in _sentences:
        lines[:] = _sentences.pop(name)


def signature(app: Sphinx, what: str, name: str, thing: Any, options: Any, given: str | None, returned: str | None) -> Any:
    """Names and defaults of a class; made-up defaults as three dots."""
    if what == "class" and given:
        found = inspect.signature(thing)
        plain = [p.replace(annotation=inspect.Parameter.empty) for p in found.parameters.values()]
        given = str(inspect.Signature(plain))
    return (given.replace("<factory>", "..."), returned) if given else None


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", keep_sentence, priority=400)  # the parser of docstrings comes at 500
    app.connect("autodoc-process-docstring", restore_sentence, priority=600)
    app.connect("autodoc-process-signature", signature)
    app.connect("doctree-read", words_stay_words)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
