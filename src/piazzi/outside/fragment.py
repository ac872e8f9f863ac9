"""A fragment of the user's own: its text, checked by its tree, becomes source that no other part of a kernel can clash with."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from piazzi.expressions.functions import TABLE

_KERNEL = {f.kernel for f in TABLE.values() if f.kernel and not f.code and not f.derived and not f.variadic}
MATHS = frozenset(_KERNEL | {"ceil", "isnan", "pow", "inf", "nan", "pi"})  # by these names, or behind ``math.``
BUILT_IN = frozenset({"abs", "float", "int", "max", "min", "range"})
DATA = ("data", "at")
_STATEMENTS = (ast.Assign, ast.AugAssign, ast.If, ast.For, ast.Return, ast.Pass, ast.Break, ast.Continue)
_EXPRESSIONS = (
    ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Name, ast.Constant, ast.Tuple, ast.Subscript, ast.Call,
    ast.Attribute, ast.operator, ast.unaryop, ast.boolop, ast.cmpop, ast.expr_context,
)  # fmt: skip


@dataclass(frozen=True)
class Fragment:
    """What a text holds: the name of its function, names of its arguments, and source for kernels with names of its own."""

    name: str
    arguments: tuple[str, ...]
    source: str

    @property
    def kind(self) -> str:
        """The function's name in the source."""
        return self.source.rpartition("def ")[2].partition("_partials(")[0]


class _Reader:
    """Checks the tree of a text, and renames what it defines."""

    def __init__(self, text: str, where: str) -> None:
        self.where, self.suffix = where, f"_{hashlib.sha256(text.encode()).hexdigest()[:10]}"
        try:
            self.body = ast.parse(text).body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = getattr(error, "lineno", None)
            raise ValueError(f"{where}{f', line {line}' if line else ''}: is not Python: {error.args[0]}") from None
        if self.body and _is_text(self.body[0]):
            del self.body[0]
        self.defined: list[str] = []
        self.functions: dict[str, ast.FunctionDef] = {}

    def fail(self, node: ast.AST, what: str) -> ValueError:
        """The error of a place in the text."""
        return ValueError(f"{self.where}, line {getattr(node, 'lineno', 1)}: {what}")

    def read(self) -> None:
        """Check all definitions, in their order: each may use those before it."""
        for node in self.body:
            if isinstance(node, ast.FunctionDef):
                self._function(node)
            elif isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
                self._constant(node, node.targets[0])
            else:
                what = type(node).__name__.replace("ImportFrom", "Import").lower()
                raise self.fail(node, f"{what} has no place in a fragment, which holds functions and literal constants only")

    def _constant(self, node: ast.Assign, target: ast.Name) -> None:
        self._new(node, target.id)
        try:
            value = ast.literal_eval(node.value)
        except (ValueError, TypeError):
            value = None
        if not all(type(v) in (int, float) for v in (value if isinstance(value, tuple) and value else [value])):
            raise self.fail(node, f"{target.id} must be a literal constant: a number, or numbers in brackets")
        self.defined.append(target.id)
        target.id += self.suffix

    def _new(self, node: ast.AST, name: str) -> None:
        if name in MATHS | BUILT_IN or name == "math":
            raise self.fail(node, f"{name!r} is a function or constant already: give it another name")
        if name in self.defined:
            raise self.fail(node, f"{name!r} is defined twice")
        if name != "_" and (name.startswith("_") or "__" in name):
            raise self.fail(node, f"{name!r}: names begin with a letter, and have single underscores")

    def _function(self, node: ast.FunctionDef) -> None:
        self._new(node, node.name)
        a = node.args
        if node.decorator_list or a.vararg or a.kwarg or a.kwonlyargs or a.posonlyargs or a.defaults:
            raise self.fail(node, f"{node.name} must be a plain function of named arguments, without decorators or defaults")
        node.returns = None
        if node.body and _is_text(node.body[0]):
            del node.body[0]
        if not node.body or not isinstance(node.body[-1], ast.Return):
            raise self.fail(node, f"{node.name} must end with a return")
        own = [argument.arg for argument in a.args]
        own += [n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
        for argument in a.args:
            argument.annotation = None
        for name in dict.fromkeys(own):
            self._new(node, name)
        for statement in node.body:
            self._check(statement, frozenset(own))
        node.body = [_Renamed(frozenset(self.defined) - set(own), self.suffix).visit(s) for s in node.body]
        self.defined.append(node.name)
        self.functions[node.name] = node
        node.name += self.suffix

    def _check(self, node: ast.AST, own: frozenset[str]) -> None:
        """Refuse what is no arithmetic, and names that come from outside of the text."""
        if isinstance(node, ast.stmt) and not isinstance(node, _STATEMENTS):
            raise self.fail(node, f"{type(node).__name__.lower()} has no place in a function of a fragment")
        if isinstance(node, ast.expr) and not isinstance(node, _EXPRESSIONS):
            raise self.fail(node, f"{type(node).__name__.lower()} has no place in a function of a fragment")
        match node:
            case ast.Name(id=name) if name not in own and name not in self.defined and name not in MATHS | BUILT_IN:
                which = "neither an argument, nor defined above, nor a function of maths"
                raise self.fail(node, f"{name!r} is not known here: {which}")
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in MATHS:
                return
            case ast.Attribute(attr=name):
                there = f"of modules there is math, with {', '.join(sorted(MATHS))}"
                raise self.fail(node, f".{name} has no place in a fragment; {there}")
            case ast.Constant(value=value) if type(value) not in (int, float, bool):
                raise self.fail(node, f"{value!r} is no number")
            case ast.Subscript(ctx=ast.Store()):
                raise self.fail(node, "data are read only")
            case ast.For(iter=ast.Call(func=ast.Name(id="range"))):
                pass
            case ast.For():
                raise self.fail(node, "a loop runs over range(...)")
            case ast.Call() if node.keywords or not isinstance(node.func, ast.Name | ast.Attribute):
                raise self.fail(node, "functions are called by name, with arguments in their order")
        for child in ast.iter_child_nodes(node):
            self._check(child, own)


class _Renamed(ast.NodeTransformer):
    """Names that the text defines get its suffix; ``math.sqrt`` becomes ``sqrt``."""

    def __init__(self, names: frozenset[str], suffix: str) -> None:
        self.names, self.suffix = names, suffix

    def visit_Name(self, node: ast.Name) -> ast.Name:
        return ast.Name(node.id + self.suffix, node.ctx) if node.id in self.names else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.Name:
        return ast.Name(node.attr, node.ctx)


def read_fragment(text: str, where: str, arguments: int, outputs: int, partials: Sequence[tuple[int, int]]) -> Fragment:
    """The fragment of a text that gives a function and its partials; raises ValueError with the line of what cannot be."""
    reader = _Reader(text, where)
    reader.read()
    pairs = [name for name in reader.functions if f"{name}_partials" in reader.functions]
    if len(pairs) != 1:
        found = f"it has {', '.join(pairs)}" if pairs else f"it has {', '.join(reader.functions) or 'none'} without"
        wanted = "one function f beside f_partials, its values with their derivatives"
        raise ValueError(f"{where}: a fragment has {wanted}; {found}")
    (name,) = pairs
    given = [a.arg for a in reader.functions[name].args.args]
    for what, results in ((name, outputs), (f"{name}_partials", outputs + len(partials))):
        _check_form(reader, reader.functions[what], given, arguments, results)
    functions = [node for node in reader.body if isinstance(node, ast.FunctionDef)]
    for node in functions:
        node.name += "_of_one" if node in (reader.functions[name], reader.functions[f"{name}_partials"]) else ""
    parts = [ast.unparse(ast.fix_missing_locations(node)) for node in reader.body if node not in functions]
    parts += ["@outlined\n" + ast.unparse(ast.fix_missing_locations(node)) for node in functions]
    takes = ", ".join(given[:arguments])
    for what in (name, f"{name}_partials"):  # the last definition is that with partials: see `kind`
        whole = reader.functions[what].name
        own = f"{name}{reader.suffix}" + what.removeprefix(name)
        passed = ", ".join([takes, *(DATA if len(given) > arguments else ())])
        parts.append(f"@inline\ndef {own}({takes}, data, at):\n    return each_lane({whole}, {passed})")
    return Fragment(name, tuple(given[:arguments]), "\n\n\n".join(parts))


def _check_form(reader: _Reader, node: ast.FunctionDef, given: list[str], arguments: int, results: int) -> None:
    """Refuse another number of arguments, or of values that are returned."""
    called = node.name.removesuffix(reader.suffix)
    own = [a.arg for a in node.args.args]
    with_data = len(own) == arguments + 2 and tuple(own[arguments:]) == DATA
    if own != given or not (len(own) == arguments or with_data):
        wanted = f"must take {arguments} arguments, and data, at behind them if it has data"
        raise reader.fail(node, f"{called}({', '.join(own)}) {wanted}")
    for n in ast.walk(node):
        if not isinstance(n, ast.Return):
            continue
        values = n.value.elts if isinstance(n.value, ast.Tuple) else [n.value] if n.value is not None else []
        if len(values) != results:
            raise reader.fail(n, f"{called} returns {len(values)} values; it must be {results}")
        n.value = ast.Tuple([ast.Call(ast.Name("float", ast.Load()), [value], []) for value in values], ast.Load())


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
