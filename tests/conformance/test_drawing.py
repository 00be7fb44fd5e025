"""The same seed draws the same cases, on every machine and at any time."""

import sys
from pathlib import Path

import pytest
from hypothesis import strategies as st
from splatbus_conformance.drawing import draw

CASES = st.lists(st.integers() | st.text() | st.floats(allow_nan=False), max_size=4)
CONSTANTS = "\n".join(f"x{n} = ({1000003 * n}, 'constant {n}', {n}.125)" for n in range(1, 20))


def test_the_same_seed_draws_the_same() -> None:
    assert draw(CASES, 200, 7) == draw(CASES, 200, 7)


def test_another_seed_draws_others() -> None:
    assert draw(CASES, 200, 7) != draw(CASES, 200, 8)


def test_no_more_than_asked_for() -> None:
    assert len(draw(CASES, 30, 0)) <= 30


def test_modules_that_are_loaded_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = draw(CASES, 400, 1)
    Path(tmp_path, "full_of_constants.py").write_text(CONSTANTS)
    monkeypatch.syspath_prepend(tmp_path)
    __import__("full_of_constants")
    assert draw(CASES, 400, 1) == before
    del sys.modules["full_of_constants"]


def test_nothing_is_left_where_the_user_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    draw(CASES, 100, 3)
    assert list(tmp_path.iterdir()) == []
