"""The page about the schemas: what it shows is what happens, and it leaves nothing out."""

import ast
import contextlib
import io
import json
import re
from typing import Any

import pytest
import splatbus_wire
from splatbus_schemas import VERSIONS, InvalidExample, ValidExample, examples, names
from splatbus_schemas.prose import CHECKOUT

PAGE = (CHECKOUT / "schemas" / "README.md").read_text("utf-8")
SNIPPETS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def is_expression(code: str) -> bool:
    try:
        ast.parse(code, mode="eval")
    except SyntaxError:
        return False
    return True


@pytest.mark.parametrize("snippet", SNIPPETS)
def test_a_snippet_does_what_its_comments_say(snippet: str) -> None:
    variables: dict[str, Any] = {}
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(snippet, "schemas/README.md", "exec"), variables)
    assert printed.getvalue().splitlines() == re.findall(r"^# (.+)$", snippet, re.MULTILINE)
    for code, value in re.findall(r"^(\S.*)  # (.+)$", snippet, re.MULTILINE):
        if is_expression(code):
            assert repr(eval(code, variables)) == value


def test_the_examples_that_it_shows_are_among_the_examples() -> None:
    (text,) = re.findall(r"^```json\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    shown, (valid, invalid) = json.loads(text), examples("opened", "1.1")
    assert [ValidExample(**each) for each in shown["valid"]] == valid[:1]
    assert [InvalidExample(**each) for each in shown["invalid"]] == [
        example for example in invalid if example.why == "generation 0"
    ]


@pytest.mark.parametrize("version", VERSIONS)
def test_it_names_each_message(version: str) -> None:
    assert set(names(version)) <= set(re.findall(r"`(\w+)`", PAGE))


def test_it_names_each_module_of_the_wire_that_others_use() -> None:
    modules = {
        path.stem for folder in splatbus_wire.__path__ for path in (CHECKOUT / folder).glob("*.py")
    }
    inner = set("__init__ decoding encoding fields from_client from_server".split())
    inner |= {"json_bounds", "message_types", "parts", "plain", "plain_frames", "plain_poses"}
    assert modules - inner <= set(re.findall(r"`(\w+)`", PAGE))
