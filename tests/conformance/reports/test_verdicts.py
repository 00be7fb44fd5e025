"""Verdicts and exit codes."""

import pytest
from splatbus_conformance.verdicts import Level, Result, Verdict, exit_code, failing, worst


def result(verdict: Verdict) -> Result:
    return Result("FRM-1", "check", Level.WIRE, verdict)


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        (["pass", "fail", "harness-error"], "fail"),
        (["pass", "harness-error", "warn"], "harness-error"),
        (["pass", "warn"], "warn"),
        (["skip", "pass"], "pass"),
        (["skip"], "skip"),
        ([], "skip"),
    ],
)
def test_the_worst_result_decides_and_a_pass_outweighs_a_skip(
    verdicts: list[str], expected: str
) -> None:
    assert worst(result(Verdict(each)) for each in verdicts) == expected


@pytest.mark.parametrize(
    ("verdicts", "strict", "code"),
    [
        (["pass", "skip"], False, 0),
        (["pass", "warn"], False, 0),
        (["pass", "warn"], True, 1),
        (["pass", "fail"], False, 1),
        (["fail", "harness-error"], False, 1),
        (["pass", "harness-error"], False, 3),
        (["skip", "skip"], False, 3),
        ([], False, 3),
    ],
)
def test_exit_codes(verdicts: list[str], strict: bool, code: int) -> None:
    named = {f"FRM-{i}": Verdict(each) for i, each in enumerate(verdicts)}
    assert exit_code(named, strict=strict) == code


def test_a_must_fails_and_a_should_warns() -> None:
    assert failing("MUST NOT") is Verdict.FAIL
    assert failing("SHOULD") is Verdict.WARN
