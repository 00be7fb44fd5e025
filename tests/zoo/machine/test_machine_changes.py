"""Mutants made by machine: what is changed of a syntax tree, and what is left."""

import ast

import pytest

from tests.zoo.machine import modules
from tests.zoo.machine.changes import Kind, changed, changes


def every(source):
    """What each change makes of a source, by its kind."""
    return [
        (Kind(it.name.split(":")[2]), ast.unparse(changed(source, it.name)))
        for it in changes(source, "m")
    ]


@pytest.mark.parametrize(
    ("source", "kind", "changed_to"),
    [
        ("x == y", Kind.COMPARISON, "x != y"),
        ("x < y", Kind.COMPARISON, "x >= y"),
        ("x < y", Kind.BOUND, "x <= y"),
        ("0 < x < y", Kind.BOUND, "0 < x <= y"),
        ("x = 7", Kind.CONSTANT, "x = 8"),
        ("x[7]", Kind.INDEX, "x[8]"),
        ("x[4:n]", Kind.INDEX, "x[5:n]"),
        ("x + y", Kind.SIGN, "x - y"),
        ("x -= y", Kind.SIGN, "x += y"),
        ("-x", Kind.SIGN, "x"),
        ("if x:\n    y", Kind.CONDITION, "if not x:\n    y"),
        ("not x", Kind.CONDITION, "x"),
        ("x and y", Kind.CONDITION, "x or y"),
        ("f(True)", Kind.CONDITION, "f(False)"),
        ("[x for x in y if x]", Kind.CONDITION, "[x for x in y if not x]"),
        ("f(x)", Kind.DROPPED, "pass"),
        ("self.x = y", Kind.DROPPED, "pass"),
        ("f(x, y)", Kind.SWAPPED, "f(y, x)"),
        ("raise X(1, 2)", Kind.LET_GO, "pass"),
        ("try:\n    x\nexcept E:\n    y", Kind.LET_GO, "try:\n    x\nexcept E:\n    raise"),
        ("with suppress(E):\n    x", Kind.LET_GO, "if True:\n    x"),
    ],
)
def test_each_kind_changes_one_thing(source, kind, changed_to):
    assert (kind, changed_to) in every(source)


@pytest.mark.parametrize(
    "source",
    [
        "x: Annotated[int, 3]",
        "log.debug('%d', 3)",
        "def f() -> Literal[3]:\n    return x",
        "min(x, y) is None or max(y, x)",
    ],
)
def test_what_only_people_read_or_what_changes_nothing_is_left(source):
    assert not {kind for kind, _ in every(source)} & {Kind.CONSTANT, Kind.SWAPPED, Kind.INDEX}


def test_every_change_of_every_module_compiles_and_is_one():
    for module in (*modules.WIRE, *modules.OWN["client"], *modules.OWN["server"]):
        source = modules.source(module).read_text("utf-8")
        found = changes(source, module)
        assert len({it.name for it in found}) == len(found)
        for change in found[::20]:
            tree = changed(source, change.name)
            assert ast.dump(tree) != ast.dump(ast.parse(source))
            compile(tree, module, "exec")


def test_a_change_keeps_its_name_while_others_come_before_it():
    (before,) = changes("def f():\n    return x < y", "m")[1:]
    after = changes("z = 3\n\n\ndef f():\n    return x < y", "m")
    assert before.name in [it.name for it in after]


def test_a_change_that_is_gone_is_an_error():
    with pytest.raises(LookupError, match="m:f:bound:1"):
        changed("x", "m:f:bound:1")
