"""Options of every command: what is typed wrong is told with what is right."""

import argparse
import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import splatbus_conformance.cli.parsing
import splatbus_splats.cli
import splatbus_viewer.cli
from splatbus_schemas.options import POSITIVE, SIZE, joined

PARSERS = {
    "splatbus-server": splatbus_splats.cli.parser,
    "splatbus-client": splatbus_viewer.cli._parser,
    "splatbus-conformance": splatbus_conformance.cli.parsing.parser,
}


def options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from options(command)


@pytest.mark.parametrize("parser", PARSERS.values(), ids=PARSERS)
def test_what_is_wrong_is_told_with_what_is_right(parser: object) -> None:
    assert callable(parser)
    read = [it for it in options(parser()) if it.type not in (None, Path)]
    assert read
    for action in read:
        for wrong in ("",) if action.metavar == "CMD" else ("", "?", "nan"):
            told = rf"^{re.escape(repr(wrong))}: give \w+ .*such as "
            with pytest.raises(argparse.ArgumentTypeError, match=told):
                action.type(wrong)  # type: ignore[operator, misc]


@pytest.mark.parametrize("wrong", ["64", "64x", "0x48", "64x-1", "64x48x3", "64.0x48", "64x32769"])
def test_a_size_is_two_whole_numbers(wrong: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=f"{wrong}': give a size such as 640x480"):
        SIZE(wrong)
    assert SIZE("64×48") == SIZE("64X48") == (64, 48)


def test_no_number_is_infinite() -> None:
    assert POSITIVE("1e-300") == 1e-300
    for wrong in ("inf", "-1", "0", str(-math.inf)):
        with pytest.raises(argparse.ArgumentTypeError, match=f"^'{wrong}': give a number above 0"):
            POSITIVE(wrong)


def test_a_value_may_begin_with_a_minus_sign() -> None:
    words = ["a.ply", "--up", "-z", "--quiet", "--up"]
    assert joined(words, "--up") == ["a.ply", "--up=-z", "--quiet", "--up"]
