"""How a server answers `hello` (1.1 chapter 2)."""

from __future__ import annotations

import hmac
from collections.abc import Collection

from splatbus_wire.message_types import ErrorMessage, Hello, Program, Welcome


def answer_hello(
    hello: Hello,
    *,
    versions: Collection[str],
    capabilities: Collection[str],
    server: Program,
    token: str | None,
) -> Welcome | ErrorMessage:
    """Return `welcome`, or the `error` after which the server closes.

    Args:
        hello: as it arrived.
        versions: those that the server speaks.
        capabilities: those that the server has on this channel.
        server: its name and version.
        token: what the client has to know, or None.

    Returns:
        `error` `unauthorized` for a token that is missing or another [NEG-18], before anything else
        is given away; `unsupported_version` with what is supported [NEG-10]; else `welcome` with
        the first version of the client's list that the server speaks [NEG-6], and the capabilities
        that both have [NEG-7]; none where that is 1.0 [NEG-33].
    """
    if token is not None and not same_token(hello.token or "", token):
        return ErrorMessage("unauthorized", "this server requires a token, and not that one")
    for version in hello.versions:
        if version in versions:
            known = () if version == "1.0" else capabilities
            shared = tuple(name for name in hello.capabilities if name in known)
            return Welcome(version, server, shared)
    return ErrorMessage(
        "unsupported_version",
        f"this server speaks {', '.join(versions)} only",
        supported=tuple(versions),
    )


def same_token(given: str, wanted: str) -> bool:
    """Whether two tokens are equal, in a time that does not tell where they differ [NEG-20]."""
    return hmac.compare_digest(given.encode(), wanted.encode())
