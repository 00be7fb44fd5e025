import pytest
from splatbus_schemas import Requirement, requirements


def test_a_requirement_has_everything_that_the_prose_says_of_it() -> None:
    assert requirements("1.0")["FRM-6"] == Requirement(
        id="FRM-6",
        level="MUST",
        binds=("client", "server"),
        acceptable=("ignores", "reconnects", "waits"),
        sentence="A receiver MUST discard an incomplete packet when the connection ends.",
        why="half an init packet from a server that died is followed, after a reconnect, by a "
        "whole one; bytes of one connection never continue those of another.",
        chapter="spec/1.0/02-framing.md",
    )


def test_a_requirement_need_not_say_why() -> None:
    assert requirements("1.0")["FRM-1"].why is None


def test_all_of_1_0_applies_in_1_1() -> None:
    former, both = requirements("1.0"), requirements("1.1")
    assert {**both, **former} == both
    assert list(both)[: len(former)] == list(former)
    assert "NEG-1" in both
    assert "NEG-1" not in former


def test_an_unknown_version_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"9\.9"):
        requirements("9.9")


def test_requirements_are_read_only() -> None:
    with pytest.raises(TypeError):
        requirements("1.0")["FRM-1"] = requirements("1.0")["FRM-2"]  # type: ignore[index]
