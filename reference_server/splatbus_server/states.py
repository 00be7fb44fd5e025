"""The states of a connection, and what leads from one to another (spec 1.1 section 2.8)."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, auto


class State(Enum):
    """Of a connection, as the server sees it."""

    NEW = auto()
    """It speaks 1.0 as far as anybody knows, and may say `hello`."""
    SPEAKS_1_1 = auto()
    AGREED_ON_1_0 = auto()
    CLOSING = auto()
    """What is unsent still goes out; what arrives is discarded [NEG-34]."""
    CLOSED = auto()


class Turn(Enum):
    """What leads from one state to another."""

    WELCOME_TO_1_1 = auto()
    WELCOME_TO_1_0 = auto()
    END = auto()
    """For the client's end of stream, or for what it did."""
    LOSS = auto()
    """Nothing is waited for any more."""


OPEN = frozenset({State.NEW, State.SPEAKS_1_1, State.AGREED_ON_1_0})
TURNS: Mapping[tuple[State, Turn], State] = {
    (State.NEW, Turn.WELCOME_TO_1_1): State.SPEAKS_1_1,
    (State.NEW, Turn.WELCOME_TO_1_0): State.AGREED_ON_1_0,
    **{(state, Turn.END): State.CLOSING for state in OPEN},
    **{(state, Turn.LOSS): State.CLOSED for state in (*OPEN, State.CLOSING)},
}
"""Every other turn leaves the state as it is."""
