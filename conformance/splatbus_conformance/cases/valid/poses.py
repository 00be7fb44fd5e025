"""Poses that are hard on arithmetic: near every edge of what the standard allows."""

import math
import random
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

NORM_SLACK = 0.0095
"""Short of the 0.01 of POS-3, so that rounding does not step over it."""
HALF = math.sqrt(0.5)
_HALF = 12
"""Bits; Hypothesis draws integers of twice as many evenly, and larger ones not."""


class Pose(NamedTuple):
    """A position, and a quaternion x, y, z, w; in whatever axes."""

    position: tuple[float, ...]
    rotation: tuple[float, ...]

    @classmethod
    def of(cls, numbers: Sequence[Sequence[float]]) -> "Pose":
        """The pose that `as_lists` gave."""
        position, rotation = numbers
        return cls(tuple(position), tuple(rotation))

    def as_lists(self) -> list[list[float]]:
        """As JSON has it."""
        return [list(self.position), list(self.rotation)]

    def __str__(self) -> str:
        return f"position {_words(self.position)}, rotation {_words(self.rotation)}"


def poses(salt: str, *, single: bool = False, unit: bool = False) -> st.SearchStrategy[Pose]:
    """Poses of every kind; others for another `salt`.

    Args:
        salt: any text.
        single: they are exact in single precision.
        unit: rotations have the norm 1 but for rounding, for engines that take another for scale.
    """
    held = np.float32 if single else np.float64
    rotations = UNIT_ROTATIONS if unit else ROTATIONS

    def pose(
        position: Callable[[random.Random], Sequence[float]],
        rotation: Callable[[random.Random], Sequence[float]],
        steered: SteeredDraw,
    ) -> Pose:
        rng = steered.rng(salt)
        place, turn = position(rng), rotation(rng)
        if position in _MAY_MOVE:
            place = steered.moved(place, len(turn))
        if rotation in _MAY_MOVE:
            turn = steered.turned(turn)
        return Pose(
            tuple(float(held(number)) for number in place),
            tuple(float(held(number)) for number in turn),
        )

    return st.builds(pose, st.sampled_from(POSITIONS), st.sampled_from(rotations), steering())


class SteeredDraw(NamedTuple):
    """What was drawn, so that a search can steer: each integer's high half has a say in everything
    that is random, and its low half moves one number a little.
    """

    integers: tuple[int, ...]

    def rng(self, salt: str) -> random.Random:
        """Another one for each combination of high halves."""
        return random.Random(f"{salt} {[number >> _HALF for number in self.integers]}")

    def moved(self, numbers: Sequence[float], first: int = 0) -> list[float]:
        """Up to seven numbers, each changed by up to an eighth of itself, in steps of 2⁻¹⁵ and, by
        other integers, 2⁻³⁴ and 2⁻⁵³ of it.

        Args:
            numbers: to be changed.
            first: how many that were changed before they follow, so that each moves by itself.
        """
        low = [(number & (2**_HALF - 1)) / 2**_HALF - 0.5 for number in self.integers[3 * first :]]
        by = zip(low[0::3], low[1::3], low[2::3], strict=False)
        return [
            number * (1.0 + coarse * 2.0**-3 + fine * 2.0**-22 + finest * 2.0**-41)
            for number, (coarse, fine, finest) in zip(numbers, by, strict=False)
        ]

    def turned(self, q: Sequence[float], first: int = 0) -> list[float]:
        """A quaternion whose parts were moved, of the norm that it had."""
        moved = self.moved(q, first)
        scale = math.hypot(*q) / math.hypot(*moved)
        return [part * scale for part in moved]


def steering() -> st.SearchStrategy[SteeredDraw]:
    """Three integers for each of seven numbers."""
    return st.tuples(*21 * [st.integers(0, 2 ** (2 * _HALF) - 1)]).map(SteeredDraw)


def simpler(numbers: list[list[float]]) -> list[list[list[float]]]:
    """A pose as lists, with a plain position, and with a plain rotation.

    Plain, and yet such that one wrong mapping does not look like another.
    """
    position, rotation = numbers
    plain = [[1.0, 2.0, 3.0], rotation], [position, [0.2, 0.4, 0.4, 0.8]]
    return [case for case in plain if case != numbers]


def _words(numbers: Sequence[float]) -> str:
    return f"({', '.join(map(repr, numbers))})"


# Positions


def _each(magnitude: Callable[[random.Random], float]) -> Callable[[random.Random], list[float]]:
    return lambda rng: [rng.choice((-1, 1)) * magnitude(rng) for _ in range(3)]


def _alike(rng: random.Random) -> list[float]:
    scale = 10 ** rng.uniform(-3, 9)
    return [rng.uniform(-scale, scale) for _ in range(3)]


POSITIONS = (
    _alike,
    _each(lambda rng: 10 ** rng.uniform(-3, 9)),
    _each(lambda rng: float(np.float32(10 ** rng.uniform(-3, 9)))),
    _each(lambda rng: float(rng.randrange(10**9))),
    _each(lambda rng: rng.randrange(1, 2**20) * 2.0**-149),
    _each(lambda rng: rng.choice((0.0, 1e-3, 0.1, 1.0, 1e9, 2.0**-1074))),
)


# Rotations


def _unit(numbers: Sequence[float]) -> list[float]:
    norm = math.hypot(*numbers)
    return [number / norm for number in numbers]


def _any(rng: random.Random) -> list[float]:
    return _unit([rng.gauss(0, 1) for _ in range(4)])


def _off_norm(rng: random.Random) -> list[float]:
    norm = rng.choice((rng.uniform(1 - NORM_SLACK, 1 + NORM_SLACK), 1 + rng.gauss(0, 1e-7)))
    return [norm * number for number in _any(rng)]


def _half_turn(rng: random.Random) -> list[float]:
    almost = rng.choice((0.0, -0.0, rng.choice((-1, 1)) * 10 ** rng.uniform(-18, -3)))
    return _unit([*_axis(rng), almost])


def _near_identity(rng: random.Random) -> list[float]:
    small = 10 ** rng.uniform(-18, -3)
    return _unit([*(small * number for number in _axis(rng)), rng.choice((-1.0, 1.0))])


def _with_zeros(rng: random.Random) -> list[float]:
    numbers = rng.choice(
        ([1.0, 0.0, -0.0, 0.0], [HALF, HALF, 0.0, -0.0], [0.5] * 4, [0.6, 0.8, -0.0, 0.0])
    )
    signed = [rng.choice((-1, 1)) * number for number in numbers]
    rng.shuffle(signed)
    return signed


def _axis(rng: random.Random) -> list[float]:
    return _unit([rng.gauss(0, 1) for _ in range(3)])


UNIT_ROTATIONS = (_any, _half_turn, _near_identity, _with_zeros)
ROTATIONS = (*UNIT_ROTATIONS, _off_norm)
_MAY_MOVE = (*POSITIONS[:2], *UNIT_ROTATIONS[:-1], _off_norm)
"""The others are of numbers that were chosen to the last bit."""
