"""Changes of axes: quaternions are those of the matrices, and the specification's example."""

import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.oracle import (
    ENGINES,
    exact,
    rotation_matrix,
    to_double,
    view_translation,
)
from splatbus_conformance.oracle.rotations import norm

every_engine = pytest.mark.parametrize("name", ENGINES)
components = st.floats(-1, 1)
quaternions = st.tuples(components, components, components, components).filter(
    lambda q: float(norm(q)) > 0.1
)
vectors = st.tuples(*[st.floats(-1e6, 1e6)] * 3)
some = settings(deadline=None, max_examples=40)


@every_engine
def test_both_changes_of_axes_are_signed_permutations_of_one_handedness(name):
    engine = ENGINES[name]
    world, camera = np.array(engine.world, float), np.array(engine.camera, float)
    for change in (world, camera):
        assert (change @ change.T == np.eye(3)).all()
    assert round(np.linalg.det(world @ camera.T)) == 1


@every_engine
@some
@given(vectors, quaternions)
def test_quaternions_turn_as_the_matrices_do_there_and_back(name, position, q):
    engine, R = ENGINES[name], rotation_matrix(q)
    there, back = engine.quaternion_from_wire(q), engine.quaternion_to_wire(q)
    for quaternion, matrix in [
        (there, engine.matrix_from_wire(R)),
        (back, engine.matrix_to_wire(R)),
    ]:
        difference = np.array(rotation_matrix(quaternion)) - np.array(matrix)
        assert np.abs(difference).max() < Fraction(2) ** -380
    same = engine.quaternion_to_wire(there)
    assert max(abs(a - b) for a, b in zip(same, exact(q), strict=True)) < Fraction(2) ** -380
    assert engine.position_to_wire(engine.position_from_wire(position)) == exact(position)


CHAPTERS = [*Path(__file__).parents[3].glob("spec/*/*-conventions.md")]
ROWS = {
    "Unity": "unity",
    "Unreal": "unreal",
    "Blender, object": "blender_object",
    "Blender, camera": "blender_camera",
    "OpenGL, world and camera": "opengl",
    "OpenGL camera, wire's world": "opengl_camera",
}
NUMBER = r"-?\d+(?:\.\d+)?"


def as_printed(text):
    """Each number of `text` and half a unit in its last place."""
    spellings = re.findall(NUMBER, text.replace("−", "-"))
    return [
        (Fraction(a), Fraction(1, 2 * 10 ** len(a.partition(".")[2])) if "." in a else 0)
        for a in spellings
    ]


def assert_prints(text, expected):
    printed = as_printed(text)
    assert len(printed) == len(expected), text
    for (value, slack), truth in zip(printed, expected, strict=True):
        assert abs(value - truth) <= slack + Fraction(2) ** -52, text


@pytest.mark.parametrize("chapter", CHAPTERS, ids=lambda path: path.parent.name)
def test_the_worked_example_is_right(chapter):
    section = re.search(r"\n## 7\.3 .*?(?=\n## )", chapter.read_text("utf-8"), re.S)[0]
    table = dict(re.findall(r"^\| (.+?) \| (\(.+\) \| \(.+\)) \|$", section, re.M))
    position, q = (
        [to_double(value) for value, _ in as_printed(cell)] for cell in table.pop("wire").split("|")
    )
    assert table.keys() == ROWS.keys()
    for row, cells in table.items():
        engine = ENGINES[ROWS[row]]
        there, turned = cells.split("|")
        assert_prints(there, engine.position_from_wire(position))
        assert_prints(turned, engine.quaternion_from_wire(q))

    lines = re.findall(r"\|(.*?)\|.*?\|(.*?)\|$", section.split("```")[1], re.M)
    assert_prints(" ".join(line[0] for line in lines), sum(rotation_matrix(q), ()))
    assert_prints(" ".join(line[1] for line in lines), view_translation(position, q))
