"""Who goes through cases ends in each what it began: a server has room for so many clients."""

import ast
import inspect
import sys
from collections.abc import Iterator

from splatbus_conformance.checks import registry
from splatbus_conformance.plan import Side

OPENS = frozenset(
    ("answered", "before_hello", "dial", "dial_narrowly", "greeted", "reading", "ready")
)


def scenarios(side: Side) -> Iterator[tuple[str, ast.FunctionDef]]:
    """What each check does in a case, as it is written."""
    for each in registry.checks_of(side):
        module = sys.modules[each.play.__module__]
        for node in ast.walk(ast.parse(inspect.getsource(module))):
            if isinstance(node, ast.FunctionDef) and node.name == each.name:
                decorators = [it for it in node.decorator_list if isinstance(it, ast.Call)]
                if any(word.arg == "cases" for it in decorators for word in it.keywords):
                    yield each.name, node


def test_no_case_ends_before_its_connection_is_closed() -> None:
    """With four such cases a server that conforms had room for no further client [IMG-18]."""
    found = dict(scenarios("server"))
    assert found
    for name, function in found.items():
        calls = [
            node
            for node in ast.walk(function)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        ]
        opened = [it.lineno for it in calls if it.func.attr in OPENS]  # type: ignore[attr-defined]
        closed = [it.lineno for it in calls if it.func.attr == "close"]  # type: ignore[attr-defined]
        for node in ast.walk(function):
            if isinstance(node, ast.Return) and opened and closed:
                assert not min(opened) < node.lineno < max(closed), f"{name} returns too early"
