"""The points at which faults are put in: each has one name, and is a public step of a program."""

import ast
import functools
import importlib
import inspect
import pkgutil
from collections import Counter
from pathlib import Path

import pytest
import splatbus_client
import splatbus_renderer
import splatbus_server
import splatbus_viewer
import splatbus_wire

from tests import zoo
from tests.zoo.faults import seams
from tests.zoo.faults.seam import Seam
from tests.zoo.registry import specimens

PROGRAMS = (splatbus_client, splatbus_renderer, splatbus_server, splatbus_viewer, splatbus_wire)
OF_NAMED_TUPLES = {"_asdict", "_fields", "_make", "_replace"}
TABLES = [
    importlib.import_module(f"{seams.__name__}.{it.name}")
    for it in pkgutil.iter_modules(seams.__path__)
]
NAMED = {
    (table, name): it for table in TABLES for name, it in vars(table).items() if name.isupper()
}


def sources(package):
    """Every module's path in the package, and its tree."""
    for path in sorted(Path(package.__path__[0]).rglob("*.py")):
        if not path.name.startswith("test_"):
            yield path, ast.parse(path.read_text("utf-8"))


def is_private(name):
    return name[:1] == "_" and name[1:2].isalpha() and name not in OF_NAMED_TUPLES


def name_of(node):
    """What a node defines or uses."""
    match node:
        case ast.Attribute(attr=name) | ast.Name(id=name):
            return name
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return name
    return ""


PRIVATE = {
    name_of(node)
    for program in PROGRAMS
    for _, tree in sources(program)
    for node in ast.walk(tree)
    if is_private(name_of(node))
}


def named(tree):
    """What private parts of the programs a module names; its own classes have theirs."""
    for node in ast.iter_child_nodes(tree):
        match node:
            case ast.Attribute(attr=name) | ast.alias(name=name) | ast.Constant(value=name):
                yield from PRIVATE & {name}
        if not isinstance(node, ast.ClassDef):
            yield from named(node)


def test_nothing_private_of_a_program_is_named():
    root = Path(zoo.__path__[0])
    found = {path.relative_to(root): list(named(tree)) for path, tree in sources(zoo)}
    assert {path: what for path, what in found.items() if what} == {}


@pytest.mark.parametrize(
    "source",
    [
        'Seam(Channel, "_warn")',
        'patch.setattr(framing, "_bad_header", 1)',
        "self._delays",
        "from splatbus_client.reading import _opened",
    ],
)
def test_what_is_private_is_found(source):
    assert list(named(ast.parse(source)))


def test_each_seam_of_the_tables_is_there_and_has_one_name():
    assert all(isinstance(it, Seam) and hasattr(it.owner, it.name) for it in NAMED.values())
    assert len(set(NAMED.values())) == len(NAMED)


def test_a_seam_that_is_not_there_cannot_be_named():
    with pytest.raises(AttributeError):
        Seam(splatbus_client, "nowhere")


def test_no_seam_is_made_twice():
    made = Counter(
        (ast.unparse(owner).rpartition(".")[2], ast.unparse(name))
        for _, tree in sources(zoo)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == Seam.__name__
        for owner, name in [node.args]
    )
    assert [seam for seam, count in made.items() if count > 1] == []


def test_each_seam_of_the_tables_has_mutants():
    used = Counter(
        ast.unparse(node)
        for _, tree in sources(zoo)
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
    )
    calls = {it: used[f"{it[0].__name__.rpartition('.')[2]}.{it[1]}"] for it in NAMED}
    assert [name for (_, name), count in calls.items() if count < 2] == []


class Shapes:
    """A `Patch` that replaces nothing, and tells what could not be called as the original is."""

    def __init__(self):
        self.wrong = []

    def setattr(self, owner, name, value):
        self.look(name, getattr(owner, name), value)

    def setitem(self, mapping, key, value):
        pass

    def wrap(self, seam, around):
        original = getattr(seam.owner, seam.name)
        self.look(seam.name, original, functools.partial(around, original))

    def look(self, name, original, value):
        if inspect.isroutine(original) and callable(value) and not inspect.isclass(value):
            for positional, named in calls(original):
                try:
                    inspect.signature(value).bind(*positional, **named)
                except TypeError as problem:
                    self.wrong.append(f"{name}: {problem}")


def calls(function):
    """The shortest and the longest way in which a function can be called."""
    known = inspect.signature(function).parameters.values()
    for taken in ([it for it in known if it.default is it.empty], known):
        positional = [
            it for it in taken if it.kind in (it.POSITIONAL_ONLY, it.POSITIONAL_OR_KEYWORD)
        ]
        yield positional, {it.name: it for it in taken if it.kind == it.KEYWORD_ONLY}


def wrong_shapes(monkeypatch, alter):
    shapes = Shapes()
    monkeypatch.setattr(Seam, "wrap", lambda seam, _, around: shapes.wrap(seam, around))
    alter(shapes)
    return shapes.wrong


@pytest.mark.parametrize("specimen", specimens(), ids=lambda it: it.name)
def test_what_takes_a_step_s_place_can_be_called_as_it_is(monkeypatch, specimen):
    """Else it would die by a TypeError, and not by what it breaks."""
    assert wrong_shapes(monkeypatch, specimen.alter) == []


@pytest.mark.parametrize("around", [lambda original, self: None, lambda *_, timeout: None])
def test_what_cannot_be_called_is_found(monkeypatch, around):
    seam = Seam(splatbus_client.Session, "ask")
    assert wrong_shapes(monkeypatch, lambda patch: seam.wrap(patch, around))
