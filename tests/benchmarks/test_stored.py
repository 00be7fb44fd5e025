"""The stored results: the code's own way lies on the front, and keeps its budget."""

import re

import pytest
from splatbus_schemas import VERSIONS, requirements

from benchmarks._shared import RESULTS
from benchmarks.accuracy import page
from benchmarks.accuracy.__main__ import STEPS
from benchmarks.accuracy.front import on_front

STORED = (*STEPS, "scene")
"""The last one is done, and kept as a result."""


def panels(name):
    return [
        (part, index)
        for part in page.stored(name)["parts"]
        for index in range(len(part["measures"]))
    ]


def default(part):
    (index,) = [i for i, each in enumerate(part["variants"]) if each["role"] == "default"]
    return index


@pytest.mark.parametrize("name", STORED)
def test_the_default_is_on_the_front(name):
    for part, measure in panels(name):
        assert default(part) in on_front(part, measure), part["measures"][measure]["title"]


@pytest.mark.parametrize("name", STORED)
def test_the_default_keeps_the_budget(name):
    for part, measure in panels(name):
        budget = part["measures"][measure]["budget"]
        found = part["variants"][default(part)]["errors"][measure]["worst"]
        assert budget is None or found <= budget, part["measures"][measure]["title"]


@pytest.mark.parametrize("name", STORED)
def test_every_error_comes_with_the_input_that_gives_it(name):
    for part, measure in panels(name):
        for variant in part["variants"]:
            worst = variant["errors"][measure]
            assert worst["input"] is not None or worst["worst"] == 0.0, variant["name"]


@pytest.mark.parametrize("name", STORED)
def test_a_budget_is_that_of_a_requirement(name):
    for part, measure in panels(name):
        about = part["measures"][measure]
        assert (about["budget"] is None) == (about["requirement"] == "")
        assert about["requirement"] in {"", *requirements(VERSIONS[-1])}


@pytest.mark.parametrize("name", STORED)
def test_there_is_a_picture(name):
    assert (RESULTS / "accuracy" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_shows_every_step_and_the_figures_that_are_stored():
    text = page.PAGE.read_text("utf-8")
    assert re.findall(r"<!-- figures: (\w+) -->", text) == list(STORED)
    assert re.findall(r"results/accuracy/(\w+)\.png", text) == list(STORED)
    assert page.filled(text) == text
