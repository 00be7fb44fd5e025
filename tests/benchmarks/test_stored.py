"""The stored results: the code's own way lies on the front, and keeps its budget."""

import re

import pytest
from splatbus_schemas import VERSIONS, requirements

from benchmarks.accuracy import page, stored
from benchmarks.accuracy.__main__ import STEPS
from benchmarks.accuracy.picture import on_front


def panels(name):
    return [
        (part, index)
        for part in stored.read(name)["parts"]
        for index in range(len(part["measures"]))
    ]


def default(part):
    (index,) = [i for i, each in enumerate(part["variants"]) if each["role"] == "default"]
    return index


@pytest.mark.parametrize("name", STEPS)
def test_the_default_is_on_the_front(name):
    for part, measure in panels(name):
        assert default(part) in on_front(part, measure), part["measures"][measure]["title"]


@pytest.mark.parametrize("name", STEPS)
def test_the_default_keeps_the_budget(name):
    for part, measure in panels(name):
        budget = part["measures"][measure]["budget"]
        found = part["variants"][default(part)]["errors"][measure]["worst"]
        assert budget is None or found <= budget, part["measures"][measure]["title"]


@pytest.mark.parametrize("name", STEPS)
def test_every_error_comes_with_the_input_that_gives_it(name):
    for part, measure in panels(name):
        for variant in part["variants"]:
            worst = variant["errors"][measure]
            assert worst["input"] is not None or worst["worst"] == 0.0, variant["name"]


@pytest.mark.parametrize("name", STEPS)
def test_a_budget_is_that_of_a_requirement(name):
    for part, measure in panels(name):
        about = part["measures"][measure]
        assert (about["budget"] is None) == (about["requirement"] == "")
        assert about["requirement"] in {"", *requirements(VERSIONS[-1])}


@pytest.mark.parametrize("name", STEPS)
def test_there_is_a_picture(name):
    assert (stored.RESULTS / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_shows_every_step_and_the_figures_that_are_stored():
    text = page.PAGE.read_text("utf-8")
    assert re.findall(r"<!-- figures: (\w+) -->", text) == list(STEPS)
    assert re.findall(r"results/accuracy/(\w+)\.png", text) == list(STEPS)
    assert page.filled(text, {name: stored.read(name) for name in STEPS}) == text
