"""Images of another size because a client asked for it: one change at a time, off the I/O thread.

Memory for images takes up to seconds to be had. Meanwhile all others are served; what the client
that asked sends after its request waits, since replies come in order [NEG-29]. A size lasts as long
as somebody who asked for it is there.
"""

from __future__ import annotations

from collections.abc import Callable

from splatbus_wire.init_packet import COLOR_PIXEL_BYTES, DEPTH_PIXEL_BYTES
from splatbus_wire.messages import SetViewport, ViewportSize

from splatbus_server.connection import Connection, Refusal
from splatbus_server.exchange import Exchange
from splatbus_server.limits import DEFAULT, Limits
from splatbus_server.logs import log
from splatbus_server.memory import FrameMemory

Chore = Callable[[], None]
"""Work that takes long, to be done off the I/O thread, which is rung afterwards."""


class Change:
    """Memory of the size that a client asked for.

    Attributes:
        asker: the client's connection; None for going back to the renderer's own size.
        request: what it asked for.
        former: memory in use then.
        outcome: the memory, or why there is none; None while it is being made.
    """

    def __init__(self, asker: Connection | None, request: SetViewport, former: FrameMemory) -> None:
        self.asker = asker
        self.request = request
        self.former = former
        self.outcome: FrameMemory | Exception | None = None

    def allocate(self) -> None:
        """Makes the memory."""
        try:
            self.outcome = self.former.successor(self.request.width, self.request.height)
        except Exception as error:
            self.outcome = error


class Viewport:
    """The change that is under way, if there is one.

    Attributes:
        chores: to be done; whoever does them takes them off the list.
        exchange: with the renderer.
        change: the one under way.
        askers: who asked for the size that images have.
        stays: generation of memory of which no successor could be had.
    """

    def __init__(self, exchange: Exchange, limits: Limits = DEFAULT) -> None:
        self.chores: list[Chore] = []
        self.exchange = exchange
        self.change: Change | None = None
        self.askers: set[Connection] = set()
        self._limits = limits
        self.stays = 0

    @property
    def is_changing(self) -> bool:
        """Whether there is one."""
        return self.change is not None

    def is_as(self, request: SetViewport) -> bool:
        """Whether images have the size that is asked for."""
        memory = self.exchange.memory
        return (memory.width, memory.height) == (request.width, request.height)

    def objection(self, request: SetViewport) -> Refusal | None:
        """Why images do not get this size, whoever asks."""
        memory, pixels = self.exchange.memory, request.width * request.height
        if pixels > self._limits.pixels:
            reason = f"{pixels} pixels: this server has images of at most {self._limits.pixels}"
            return Refusal("unsupported", reason)
        needed = memory.ring.slots * (COLOR_PIXEL_BYTES + DEPTH_PIXEL_BYTES) * pixels
        most = int(self._limits.share * memory.free_bytes())
        if needed > most:
            return Refusal("unsupported", f"{needed} bytes: a client may have {most} of those free")
        return None

    def set(self, asker: Connection, request: SetViewport) -> None:
        """Begins what nothing hinders; replies at once where nothing changes [VPT-6]."""
        if self.is_as(request):
            self.askers.add(asker)
            asker.send(ViewportSize(*request))
            return
        self.begin(asker, request)
        asker.hold()

    @property
    def is_left_over(self) -> bool:
        """Whether nobody is there any more who asked for the size that images have."""
        memory = self.exchange.memory
        return (
            not (self.askers or self.is_changing or self.exchange.replaced)
            and (memory.width, memory.height) != self.exchange.own_size
            and memory.generation != self.stays
        )

    def begin(self, asker: Connection | None, request: SetViewport) -> None:
        """Has memory made of another size, which a client asked for or the renderer had."""
        self.change = Change(asker, request, self.exchange.memory)
        self.chores.append(self.change.allocate)

    def settle(
        self, hindrance: Callable[[Connection], Refusal | None], now: float
    ) -> Refusal | None:
        """Replies once the memory has been had, or could not be [VPT-2]; returns an error sent.

        Args:
            hindrance: why a client's wish cannot be granted, which may have changed meanwhile.
            now: the moment.
        """
        change = self.change
        if change is None or change.outcome is None:
            return None
        self.change, asker = None, change.asker
        refusal = asker and hindrance(asker)
        refusal = refusal or self.replace(change)
        if refusal is None:
            self.askers = {asker} if asker is not None and asker.is_open else set()
        else:
            log.warning("%d×%d refused: %s", *change.request[:2], refusal.reason)
            self._discard(change)
            self.stays = self.exchange.memory.generation if asker is None else self.stays
        if asker is not None:
            if refusal is None:
                asker.send(ViewportSize(*change.request))
            else:
                asker.complain(refusal._replace(id=change.request.id))
            asker.go_on(now)
        return refusal

    def close(self) -> None:
        """Frees what was made for a reply that will not be sent any more."""
        if self.change is not None:
            self._discard(self.change)
        while self.chores:
            self.chores.pop(0)()

    def replace(self, change: Change) -> Refusal | None:
        """Puts the new memory in the place of the former, or says why not."""
        made = change.outcome
        if isinstance(made, OSError):
            return Refusal("unsupported", made.strerror or str(made))
        if isinstance(made, MemoryError):
            return Refusal("unsupported", str(made) or "there is no memory for such images")
        if isinstance(made, Exception):
            log.error("a defect of this server", exc_info=made)
            return Refusal("internal", "a defect of this server")
        if made is None or not self.exchange.replace(change.former, made):
            return Refusal("busy", "the renderer has changed the size itself [VPT-4]")
        return None

    def _discard(self, change: Change) -> None:
        if change.outcome is not None and not isinstance(change.outcome, Exception):
            self.chores.append(change.outcome.close)
