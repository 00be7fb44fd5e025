"""The states of a connection: the table is whole, and says what the specification's does."""

import itertools

import pytest
from splatbus_server.states import OPEN, TURNS, State, Turn


@pytest.mark.parametrize(("state", "turn"), [*itertools.product(State, Turn)])
def test_nothing_leads_back(state: State, turn: Turn) -> None:
    order = [*State]
    after = TURNS.get((state, turn), state)
    assert order.index(after) >= order.index(state)
    assert after in OPEN or turn in (Turn.END, Turn.LOSS) or state not in OPEN


def test_a_version_is_settled_once() -> None:
    """[NEG-31, NEG-33]"""
    for settled in (State.SPEAKS_1_1, State.AGREED_ON_1_0):
        assert (settled, Turn.WELCOME_TO_1_1) not in TURNS
        assert (settled, Turn.WELCOME_TO_1_0) not in TURNS


def test_whatever_is_open_can_end() -> None:
    assert {TURNS[state, Turn.END] for state in OPEN} == {State.CLOSING}
    assert all((state, Turn.LOSS) in TURNS for state in State if state is not State.CLOSED)
