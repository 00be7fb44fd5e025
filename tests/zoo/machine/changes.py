"""Small changes of a module's syntax tree, each found again by its name."""

import ast
from collections import Counter
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Kind(StrEnum):
    """What is changed."""

    COMPARISON = "comparison"
    """Turned into its contrary."""
    BOUND = "bound"
    """Lets in the limit, or keeps it out."""
    CONSTANT = "constant"
    """One more."""
    INDEX = "index"
    """One further."""
    SIGN = "sign"
    """Plus for minus, minus for plus, or none."""
    CONDITION = "condition"
    """Turned."""
    DROPPED = "dropped"
    """A statement left out."""
    SWAPPED = "swapped"
    """The first two arguments of a call."""
    LET_GO = "let-go"
    """An exception that is not raised, or not caught."""


@dataclass(frozen=True)
class Change:
    """One change of one module."""

    name: str
    """Module, function, kind and number among its like there: stays while that function does."""
    line: int
    lines: tuple[int, int]
    """If any of these, from first to last, is executed, so is what was changed."""
    before: str
    after: str

    @property
    def module(self) -> str:
        """That is changed."""
        return self.name.partition(":")[0]


CONTRARY: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
BESIDE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
}
OTHER_SIGN: dict[type[ast.operator], type[ast.operator]] = {ast.Add: ast.Sub, ast.Sub: ast.Add}
FOR_READERS = frozenset({"annotation", "returns", "decorator_list"})
"""Fields whose change nobody would notice, or everybody at once."""
UNCHANGED = (ast.Raise, ast.JoinedStr, ast.Assert, ast.Import, ast.ImportFrom)
"""Nothing inside these is changed: it is what people read, or decides what can be imported."""
UNSWAPPED = frozenset(
    {
        *("isinstance", "issubclass", "cast", "TypeVar", "getattr", "NamedTuple"),
        *("min", "max", "add", "multiply", "maximum", "minimum", "bitwise_and", "bitwise_xor"),
    }
)
"""Calls whose swapped arguments are an error at once, or the same."""
Found = tuple[Kind, ast.AST]


def changes(source: str, module: str) -> list[Change]:
    """Every change of a module that there is."""
    visitor = _Visitor(module)
    visitor.visit(ast.parse(source))
    return visitor.found


def changed(source: str, name: str) -> ast.Module:
    """The tree with the change of this name. Raises LookupError if there is none any more."""
    visitor = _Visitor(name.partition(":")[0], name)
    tree: ast.Module = visitor.visit(ast.parse(source))
    if name not in [change.name for change in visitor.found]:
        raise LookupError(f"there is no change {name}")
    return ast.fix_missing_locations(tree)


class _Visitor:
    """Goes through a tree, notes each change, and makes the one that is wanted."""

    def __init__(self, module: str, wanted: str = "") -> None:
        self.found: list[Change] = []
        self._module, self._wanted = module, wanted
        self._scope: list[str] = []
        self._lines = (1, 1)
        self._index = False
        self._counts: Counter[tuple[str, Kind]] = Counter()

    def visit(self, node: Any) -> Any:
        """The node, or what stands in its place."""
        former = self._lines, self._index
        if isinstance(node, ast.stmt | ast.ExceptHandler):
            self._lines = _span(node)
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            self._scope.append(node.name)
        elif isinstance(node, ast.stmt):
            self._index = False
        for kind, other in _found(node, self._index, self._scope):
            if self._note(kind, node, other):
                node = other
                break
        else:
            if not isinstance(node, UNCHANGED) and not _for_readers(node):
                self._descend(node)
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            self._scope.pop()
        self._lines, self._index = former
        return node

    def _descend(self, node: ast.AST) -> None:
        for name, value in ast.iter_fields(node):
            if name in FOR_READERS:
                continue
            if isinstance(node, ast.Subscript):
                self._index = name == "slice"
            if isinstance(value, list):
                value[:] = [self.visit(it) if isinstance(it, ast.AST) else it for it in value]
            elif isinstance(value, ast.AST):
                setattr(node, name, self.visit(value))

    def _note(self, kind: Kind, node: Any, other: ast.AST) -> bool:
        """Note a change; whether it is the one that is wanted."""
        where = ".".join(self._scope)
        self._counts[where, kind] += 1
        name = f"{self._module}:{where}:{kind}:{self._counts[where, kind]}"
        line = getattr(node, "lineno", self._lines[0])
        self.found.append(Change(name, line, self._lines, _text(node), _text(other)))
        return name == self._wanted


def _found(node: ast.AST, index: bool, scope: list[str]) -> Iterator[Found]:
    """What can be changed about a node itself, and what stands there then."""
    match node:
        case ast.Compare(ops=[op]):
            yield Kind.COMPARISON, _with(node, ops=[CONTRARY[type(op)]()])
            yield from _bounds(node)
        case ast.Compare():
            yield from _bounds(node)
        case ast.Constant(value=bool(value)):
            yield Kind.CONDITION, ast.Constant(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield Kind.INDEX if index else Kind.CONSTANT, ast.Constant(value + 1)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield Kind.SIGN, operand
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield Kind.CONDITION, operand
        case ast.BinOp(op=ast.Add() | ast.Sub() as op) if not _is_text(node.left, node.right):
            yield Kind.SIGN, _with(node, op=OTHER_SIGN[type(op)]())
        case ast.AugAssign(op=op):
            if type(op) in OTHER_SIGN:
                yield Kind.SIGN, _with(node, op=OTHER_SIGN[type(op)]())
            yield Kind.DROPPED, ast.Pass()
        case ast.BoolOp(op=op):
            yield Kind.CONDITION, _with(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test) if _turns(test):
            yield Kind.CONDITION, _with(node, test=ast.UnaryOp(ast.Not(), test))
        case ast.comprehension(ifs=[test]) if _turns(test):
            yield Kind.CONDITION, _with(node, ifs=[ast.UnaryOp(ast.Not(), test)])
        case ast.Call(args=[first, second, *rest]) if _swaps(node, first, second):
            yield Kind.SWAPPED, _with(node, args=[second, first, *rest])
        case ast.Expr(value=ast.Call()) if not _for_readers(node.value):
            yield Kind.DROPPED, ast.Pass()
        case ast.Assign(targets=targets) if scope[-1:] != ["__init__"] and _elsewhere(targets):
            yield Kind.DROPPED, ast.Pass()
        case ast.Delete() | ast.Break() | ast.Continue() | ast.Return(value=None):
            yield Kind.DROPPED, ast.Pass()
        case ast.Raise():
            yield Kind.LET_GO, ast.Pass()
        case ast.ExceptHandler(body=body) if not isinstance(body[0], ast.Raise):
            yield Kind.LET_GO, _with(node, body=[ast.Raise()])
        case ast.With(items=items, body=body) if any("suppress(" in _text(it) for it in items):
            yield Kind.LET_GO, ast.If(ast.Constant(True), body, [])


def _bounds(node: ast.Compare) -> Iterator[Found]:
    for place, op in enumerate(node.ops):
        if beside := BESIDE.get(type(op)):
            ops = [*node.ops[:place], beside(), *node.ops[place + 1 :]]
            yield Kind.BOUND, _with(node, ops=ops)


def _with(node: Any, **fields: Any) -> Any:
    other = copy(node)
    for name, value in fields.items():
        setattr(other, name, value)
    return other


def _turns(test: ast.expr) -> bool:
    """Turning it is no other change's business, and changes something."""
    compared = isinstance(test, ast.Compare) and len(test.ops) == 1
    negated = isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)
    return not (compared or negated or isinstance(test, ast.Constant))


def _swaps(call: ast.Call, first: ast.expr, second: ast.expr) -> bool:
    starred = isinstance(first, ast.Starred) or isinstance(second, ast.Starred)
    unswapped = _text(call.func).rpartition(".")[2] in UNSWAPPED
    return not (starred or unswapped or _for_readers(call) or _text(first) == _text(second))


def _elsewhere(targets: list[ast.expr]) -> bool:
    """What is assigned is kept by something that lives longer than the function."""
    return all(isinstance(it, ast.Attribute | ast.Subscript) for it in targets)


def _is_text(*operands: ast.expr) -> bool:
    return any(
        isinstance(it, ast.JoinedStr | ast.List | ast.Tuple)
        or (isinstance(it, ast.Constant) and isinstance(it.value, str | bytes))
        for it in operands
    )


def _for_readers(node: ast.AST) -> bool:
    """A call that writes into the log."""
    return isinstance(node, ast.Call) and _text(node.func).startswith("log.")


def _span(node: ast.stmt | ast.ExceptHandler) -> tuple[int, int]:
    """The lines of a statement without the statements inside it."""
    if isinstance(node, ast.ExceptHandler):
        return node.body[0].lineno, node.body[0].end_lineno or node.body[0].lineno
    inside = getattr(node, "body", None)
    if isinstance(inside, list) and inside:
        return node.lineno, max(node.lineno, inside[0].lineno - 1)
    return node.lineno, node.end_lineno or node.lineno


def _text(node: ast.AST) -> str:
    """The first line of its source, for people."""
    text = ast.unparse(node)
    return text.splitlines()[0][:160]
