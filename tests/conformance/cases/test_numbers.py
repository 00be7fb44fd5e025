"""Decimals that are hard to read, and what is nearest to them: against Python's own parser."""

from fractions import Fraction

from splatbus_conformance.cases.drawing import draw
from splatbus_conformance.cases.valid.numbers import hard_numbers, nearest, spelled_as
from splatbus_conformance.wire.messages import camera_pose

NUMBERS = draw(hard_numbers(), 400, 0)


def test_many_lie_halfway_between_two_doubles_or_right_beside() -> None:
    assert [nearest(text) for text in NUMBERS] == [float(text) for text in NUMBERS]
    exact = [(Fraction(text), Fraction(float(text))) for text in NUMBERS]
    far = [abs(right - near) / abs(near) * 2**53 for right, near in exact if near]
    assert sum(0.4 < float(error) <= 1.0 for error in far) > 100
    assert sum(error == 0 for error in far) > 30


def test_a_pose_keeps_its_members() -> None:
    payload = spelled_as(camera_pose(), {"x": "1.50", "y": "-0.0", "z": "2e3"})
    assert b'"position":{"x":1.50,"y":-0.0,"z":2e3},"rotation"' in payload
