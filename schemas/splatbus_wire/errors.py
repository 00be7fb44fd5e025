"""The errors that a peer's bytes can cause: what is wrong, where, and which requirement says so."""

from __future__ import annotations

from typing import Any


class ProtocolError(ValueError):
    """A message breaks a requirement; the connection goes on.

    Args:
        code: the error's name on the wire, such as `invalid_rotation`.
        message: one sentence for the author of the peer.
        requirement: id of the clause that is broken, such as `POS-3`.
        pointer: JSON pointer (RFC 6901) to the offending value, where there is one.
        offset: offset in bytes of the fault within the payload or stream, where there is one.

    Attributes:
        received: the message that is refused, as it was parsed; empty where it was not.
    """

    def __init__(
        self,
        code: str,
        message: str,
        *,
        requirement: str,
        pointer: str | None = None,
        offset: int | None = None,
    ) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.requirement = requirement
        self.pointer = pointer
        self.offset = offset
        self.received: dict[str, Any] = {}

    def __str__(self) -> str:
        where = "" if self.pointer is None else f" at {self.pointer or 'the root'}"
        where += "" if self.offset is None else f" at byte {self.offset}"
        return f"{self.message}{where} [{self.requirement}]"


class FramingError(ProtocolError):
    """The stream can no longer be cut into packets; the connection must close."""
