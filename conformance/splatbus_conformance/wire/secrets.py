"""The token of who runs the harness: it comes from the environment, and goes into no report."""

import os
import re
from typing import Any

TOKEN_VARIABLE = "SPLATBUS_TOKEN"
"""Holds the token for a server that requires one, as NEG-21 advises."""
NAMED = f"${TOKEN_VARIABLE}"
"""What stands in its place; in a command that the harness starts, what the variable holds is put
there again."""
LEAST_SHOWN = 8
"""Characters from which a token is looked for in a text: shorter ones stand there by chance."""
_OPTION = re.compile(r"(--token(?:=|\s+))(?:\"[^\"]*\"|'[^']*'|[^\s'\"]+)")


def own_token() -> str:
    """The token, empty if there is none."""
    return os.environ.get(TOKEN_VARIABLE, "")


def hidden(text: str) -> str:
    """The text with the name of the variable where the token stands, or that of an option."""
    return str(_hidden(text, own_token()))


def hidden_in(value: Any) -> Any:
    """As `hidden`, of each text in lists and objects."""
    return _hidden(value, own_token())


def _hidden(value: Any, token: str) -> Any:
    if isinstance(value, str):
        if len(token) >= LEAST_SHOWN:
            value = value.replace(token, NAMED)
        return _OPTION.sub(_named, value) if "--token" in value else value
    if isinstance(value, dict):
        return {name: _hidden(each, token) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_hidden(each, token) for each in value]
    return value


def _named(found: re.Match[str]) -> str:
    return found[1] + NAMED
