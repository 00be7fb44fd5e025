"""What `hello` and `welcome` have in common, and what a `hello` shows (spec 1.1 chapter 2)."""

from collections.abc import Iterator
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.rules import Breach, Judgement
from splatbus_conformance.wire.json_values import MAX_CHARS, is_version, show, text_of

Json = dict[str, Any]


def hello(value: Json) -> Iterator[Judgement]:
    """What a `hello` shows of NEG-2."""
    yield Judgement("NEG-2")
    versions, client = value.get("versions"), value.get("client")
    listed, token = value.get("capabilities"), value.get("token", "none")
    if not (isinstance(versions, list) and 1 <= len(versions) <= LIMITS["max_versions"]):
        text = f"versions is {show(versions)}, no array of 1 to {LIMITS['max_versions']} strings"
        yield Judgement("NEG-2", Breach("not-an-array", text), "/versions")
    else:
        for i, version in enumerate(versions):
            if not is_version(version):
                text = f"{show(version)} is no version: two integers joined by a dot"
                yield Judgement("NEG-2", Breach("not-a-version", text), f"/versions/{i}")
    yield from named(client, "client", "NEG-2")
    yield from listing(listed, "NEG-2")
    if not text_of(token, 1, LIMITS["max_token_chars"]):
        text = f"token is no string of 1 to {LIMITS['max_token_chars']} characters"
        yield Judgement("NEG-2", Breach("bad-string", text), "/token")


def named(program: object, role: str, requirement: str) -> Iterator[Judgement]:
    """Whether a peer names itself: an object of `name` and `version`, strings."""
    if not isinstance(program, dict):
        text = "is missing" if program is None else f"is {show(program)}, no object"
        code = "missing-member" if program is None else "not-an-object"
        yield Judgement(requirement, Breach(code, f"{role} {text}"), f"/{role}")
        return
    for member in ("name", "version"):
        if not text_of(program.get(member), 0, MAX_CHARS):
            has = show(program[member]) if member in program else "missing"
            text = f"{member} is {has}, no string of up to {MAX_CHARS} characters"
            yield Judgement(requirement, Breach("bad-string", text), f"/{role}/{member}")


def listing(listed: object, requirement: str) -> Iterator[Judgement]:
    """Whether capabilities are an array of different strings."""
    most = LIMITS["max_capabilities"]
    if not (isinstance(listed, list) and len(listed) <= most):
        text = f"capabilities is {show(listed)}, no array of up to {most} strings"
        yield Judgement(requirement, Breach("not-an-array", text), "/capabilities")
        return
    for i, capability in enumerate(listed):
        if not text_of(capability, 0, MAX_CHARS):
            text = f"{show(capability)} is no string of up to {MAX_CHARS} characters"
            yield Judgement(requirement, Breach("bad-string", text), f"/capabilities/{i}")
        elif capability in listed[:i]:
            breach = Breach("not-unique", f"{show(capability)} is listed twice")
            yield Judgement(requirement, breach, "/capabilities")
