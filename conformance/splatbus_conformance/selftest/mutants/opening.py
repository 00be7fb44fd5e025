"""Mutants that break OPN: the answers to init packets."""

from typing import Any

import pytest
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_wire.messages import Closed, Opened, encode

from splatbus_conformance.selftest.mutants.negotiation import without
from splatbus_conformance.selftest.specimen import mutant
from splatbus_conformance.selftest.surgery import messages, of_type, wrap


@mutant("OPN-1", reason="is answered a second time")
def answers_twice(patch: pytest.MonkeyPatch) -> None:
    """Answers `opened` twice."""

    def opened(original: Any, self: IpcProtocol, packet: Any) -> None:
        self._out += encode(Opened(packet.generation))
        original(self, packet)

    wrap(patch, IpcProtocol, "opened", opened)


@mutant("OPN-1", reason="generation is missing")
def answers_without_a_generation(patch: pytest.MonkeyPatch) -> None:
    """Answers `opened` without saying what."""
    messages(patch, of_type("opened", without("generation")))


@mutant("OPN-3", reason="reason is null", through="MEM-6")
def declines_without_a_reason(patch: pytest.MonkeyPatch) -> None:
    """Answers `open_failed` without a reason."""
    messages(patch, of_type("open_failed", without("reason")))


@mutant("OPN-3", reason='reason is "", no string of 1', through="MEM-6")
def declines_with_an_empty_reason(patch: pytest.MonkeyPatch) -> None:
    """Answers `open_failed` with an empty reason."""
    messages(patch, of_type("open_failed", lambda failed: failed | {"reason": ""}))


@mutant("OPN-3", reason="no string of 1 to 1,024", through="MEM-6")
def declines_at_length(patch: pytest.MonkeyPatch) -> None:
    """Answers `open_failed` with a reason of 2,000 characters."""
    messages(patch, of_type("open_failed", lambda failed: failed | {"reason": "no " * 667}))


@mutant("OPN-5", reason="is closed before a later one is answered", through="NEG-4")
def closes_before_it_opens(patch: pytest.MonkeyPatch) -> None:
    """Says that the old memory is closed before it answers for the new."""

    def opened(original: Any, self: IpcProtocol, packet: Any) -> None:
        for generation in self._slots:
            self._out += encode(Closed(generation))
        original(self, packet)

    wrap(patch, IpcProtocol, "opened", opened)


@mutant("OPN-11", reason="had generation 0")
def counts_generations_from_zero(patch: pytest.MonkeyPatch) -> None:
    """Answers with a generation that is one too small."""
    messages(
        patch, of_type("opened", lambda opened: opened | {"generation": opened["generation"] - 1})
    )
