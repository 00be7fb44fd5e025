"""Stress poses are allowed, hard, and the same for the same seed."""

import math

import numpy as np
import pytest
from splatbus_conformance.cases.drawing import draw
from splatbus_conformance.cases.valid.poses import SteeredDraw, poses

DOUBLE = draw(poses("a"), 600, 0)


@pytest.mark.parametrize("single", [False, True])
def test_every_pose_is_allowed_and_held_as_asked(single):
    for unit, most in (False, 0.01), (True, 2.0**-23 if single else 2.0**-52):
        for pose in draw(poses("a", single=single, unit=unit), 600, 0):
            numbers = (*pose.position, *pose.rotation)
            assert all(abs(number) <= 3.4028234663852886e38 for number in numbers)
            assert abs(math.hypot(*pose.rotation) - 1) <= most
            assert not single or all(float(np.float32(number)) == number for number in numbers)


@pytest.mark.parametrize(
    "hard",
    [
        lambda p, q: any(0 < abs(n) < 2.3e-308 for n in p),
        lambda p, q: any(abs(n) >= 1e8 for n in p),
        lambda p, q: any(n == 0 and math.copysign(1, n) < 0 for n in (*p, *q)),
        lambda p, q: abs(q[3]) < 1e-6,
        lambda p, q: 0 < math.hypot(*q[:3]) < 1e-6,
        lambda p, q: q[3] < -0.1,
        lambda p, q: abs(math.hypot(*q) - 1) > 0.005,
    ],
)
def test_every_hardship_is_drawn(hard):
    assert sum(hard(*pose) for pose in DOUBLE) >= 5


def test_another_salt_draws_others():
    assert not {*draw(poses("b"), 50, 0)} & {*DOUBLE}


def test_a_search_moves_one_number_by_much_or_by_little():
    numbers, near = [1.0, 2.0, 3.0], SteeredDraw(21 * (5,))
    before = near.moved(numbers)
    for at, step in ((3, 2.0**-15), (4, 2.0**-34), (5, 2.0**-53)):
        stepped = SteeredDraw((*near.integers[:at], 6, *near.integers[at + 1 :]))
        assert stepped.rng("a").random() == near.rng("a").random()
        changed = [a - b for a, b in zip(stepped.moved(numbers), before, strict=True)]
        assert changed == pytest.approx([0.0, 2.0 * step, 0.0], rel=0.5, abs=0.0)
    other = SteeredDraw((5 + 2**12, *near.integers[1:]))
    assert other.rng("a").random() != near.rng("a").random()
