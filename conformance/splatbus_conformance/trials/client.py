"""A trial of a client, from its connecting to judgement: the harness plays the server."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from splatbus_conformance.images.painted import Painting
from splatbus_conformance.images.pictures import Picture, pictures_of_reading
from splatbus_conformance.trials.returning import ReturningTrial
from splatbus_conformance.trials.testee.adapter import (
    Adapted,
    AdapterBroken,
    ClientCrashed,
    Greeting,
)
from splatbus_conformance.trials.testee.client_probe import RETURN_SECONDS
from splatbus_conformance.trials.testee.probe_advice import does_not_come
from splatbus_conformance.trials.trial import (
    EFFECT_SECONDS,
    REACTION_SECONDS,
    LostSign,
    NotObservable,
    Violation,
)
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import Connection

MANY_CONNECTIONS = 6
"""From which on the quick profile delivers only what it has to."""
STARTING_SECONDS, STARTS_SOONER = 0.5, 2.0
"""What it takes to end a testee beside its start; and how much longer it has to stay away."""
MOST_PLACES = 4096
"""That an adapter is asked for at once, of a picture."""
ABOUT_READING = ("FRM", "JSN", "INI", "MEM", "REQ")
"""Clauses whose checks have many cases, and look at nothing that a testee keeps between them."""


class ClientTrial(ReturningTrial):
    """What a check of a client has in hand: the role that the harness plays as well."""

    def affords(self) -> bool:
        """In the quick profile not, once the testee needs many connections.

        A client may close the connection on whatever is wrong, and each case then costs it a pause.
        """
        return self.thorough or len(self.peer.connections) < MANY_CONNECTIONS

    def judge(self, outcome: str, what: str) -> None:
        """As of every trial; one that ends once its server has gone does no less than wait."""
        if outcome == "exits" and self.facts.leaves and "waits" in self.requirement.acceptable:
            outcome = "waits"
        super().judge(outcome, what)

    # Meeting the testee

    def connection(self, channel: Channel, seconds: float | None = None) -> Connection:
        """A connection of the testee on this channel that this trial has not used yet.

        Closes those that it has used, so that the testee makes a new one, and starts it anew where
        that does not help. One that was seen to come back, and does not, has lost a vital sign.
        Skips the check if none comes within the run's patience.
        """
        seconds = self.return_seconds() if seconds is None else seconds
        if self._used and "exits" not in self.requirement.acceptable:
            self.charge_its_end()
        if self.testee.ended() or self._takes_a_start(channel) or self._starts_sooner(channel):
            self.end_testee()
            if not self.testee.asked_to_start(self.purpose):
                self.not_observable("it would take a further start of the client by hand")
        started = self.testee.ensure_running()
        found = self.past_probes(channel, seconds)
        if found is None and not started:
            self.peer.close_all()  # some come back to both channels or to none
            found = self.past_probes(channel, min(seconds, RETURN_SECONDS))
        if found is None and not started:
            if channel in self.facts.returns:
                self._note_loss(does_not_come(channel, self.testee), channel)
            self.end_testee()
            if self.testee.ensure_running():
                found = self.past_probes(channel, seconds)
        if found is None:
            self.not_observable(f"the testee made no connection on the {channel} channel")
        return found

    def charge_its_end(self) -> None:
        """That what was sent has ended the process is charged to the sentence that forbids it."""
        ended = self.testee.ended()
        if ended and not self.killed and not self.facts.leaves:
            self._note_loss(f"its process {ended}")
            self.end_testee()

    def renew(self) -> None:
        """Have the next connection be made by a testee that was just started, where that can be."""
        if self.testee.expendable:
            self.end_testee()

    def _starts_sooner(self, channel: Channel) -> bool:
        """One that was just started is there before this one has come back; that it does come back
        shows in the first connection of each check, and where one asks for it.
        """
        returns = any(used.channel == channel for used in self._used)
        in_use = any(used.channel != channel and not used.gone for used in self._used)
        starts = self.facts.start_seconds + STARTING_SECONDS
        sooner = self.facts.away_seconds > STARTS_SOONER * starts
        sooner = sooner and self.requirement.id.startswith(ABOUT_READING)
        return self.testee.expendable and returns and not in_use and sooner

    def _takes_a_start(self, channel: Channel) -> bool:
        """Only a testee that is started anew connects there: this one has done so, and is gone."""
        came = self.peer.last_opened[channel] > self.testee.started
        comes = channel in self.facts.returns or channel not in self.facts.connects
        return came and not comes and self._unused(channel) is None

    def _note_loss(self, what: str, channel: Channel | None = None) -> None:
        alive = any(connection.channel == channel for connection in self.peer.connections)
        self.losses.append(LostSign(what, None if alive else channel, list(self.peer.entries)))

    def greeted(self, channel: Channel) -> Connection:
        """A new connection on which the testee has said `hello` and was given `welcome`."""
        connection = self.connection(channel)
        self.role.welcome_whoever_waits(connection)
        self._answers(lambda: self.with_(connection).welcome)
        if self.with_(connection).welcome is None:
            if self.facts.speaks_1_1(channel) and not connection.ended:
                self._note_loss(f"it says no hello on the {WORDS[channel]} channel any more")
                self.renew()
            self.not_observable("the testee said no hello on this connection")
        return connection

    def for_init_packet(self) -> Connection:
        """A greeted IPC connection that may be sent one more init packet: the last one if it may.

        Only with `role.offers_memory` off, so that the check sends every init packet itself.
        """
        found = self.peer.newest(
            "ipc", lambda it: it in self._used and not it.gone and self._takes_another(it)
        )
        return found or self.greeted("ipc")

    def reassure(self, channel: Channel) -> None:
        """Serve a connection well, the newest if it is open: a client may wait twice as long after
        each that came to nothing, and a check that has many of them would wait most of the time.
        """
        speaks = self.facts.speaks_1_1(channel)
        if channel not in self.facts.returns or not (speaks or channel == "msg"):
            return
        withheld = self.role.welcomes, self.role.replies
        self.role.welcomes = self.role.replies = True
        newest = [c for c in self.peer.connections if c.channel == channel and c in self._used][-1:]
        on_it = [c for c in newest if not c.gone] or [self.connection(channel)]
        dealings = self.with_(on_it[0])
        self.wait(lambda: (dealings.welcome if speaks else dealings.heard) or on_it[0].ended)
        self.role.welcomes, self.role.replies = withheld

    # Asking the adapter beside it

    @property
    def greeting(self) -> Greeting:
        """What the adapter says of itself."""
        assert self.facts.adapter is not None, "a check that asks needs an adapter"
        return self.facts.adapter

    def ask(self, command: str, **members: Any) -> Json:
        """Give the adapter a command; its answer.

        A client that dies over it violates the requirement. Raises AdapterBroken.
        """
        self.give(command, **members)
        return self.take(command)

    def give(self, command: str, **members: Any) -> None:
        """Give the adapter a command, and do not wait: `take` the answer before the next."""
        self._adapted().give(command, **members)

    def take(self, command: str) -> Json:
        """The answer to a command that was given, as `ask` has it."""
        try:
            return self._adapted().take(command)
        except ClientCrashed as crash:
            self.violated("dies", f"told to {command}, {crash}")
        except AdapterBroken:
            if not (self.facts.leaves and self.fate() == "exits"):
                raise
            self.not_observable("it has ended with its server, as it may (CHN-17)")

    def _adapted(self) -> Adapted:
        assert isinstance(self.testee, Adapted), "a check that asks needs an adapter"
        return self.testee

    def pictures(self) -> tuple[Picture, ...]:
        """What the client shows of the image that it read last, beside what it was lent."""
        if not self.lent or "pixels" not in self.greeting.can:
            return ()
        width, height = self.role.width, self.role.height
        step = math.isqrt(width * height // MOST_PLACES) + 1
        rows, columns = range(0, height, step), range(0, width, step)
        try:
            told = self.ask("pixels", at=[[column, row] for row in rows for column in columns])
        except (AdapterBroken, Violation, NotObservable):
            return ()
        lent = self.lent.get(told["seq"])
        if lent is None or told["color"] is None or lent.depth.shape != (height, width):
            return ()
        whole = Painting(*(each[::step, ::step] for each in lent))
        planes = (whole.depth if told[name] is None else told[name] for name in ("color", "depth"))
        read = (np.asarray(each, np.float32) for each in planes)
        return pictures_of_reading(
            Painting(*(each.reshape(it.shape) for each, it in zip(read, whole, strict=True))), whole
        )

    # Waiting and watching

    def _answers(self, condition: Callable[[], Any]) -> bool:
        """Wait for an answer, and note how long it took."""
        began = self.peer.clock()
        if came := self.wait(condition):
            self.facts.took(self.peer.clock() - began)
        return came

    def require_open(self, connection: Connection) -> None:
        """Skip the check if the testee does not open the memory that was offered last."""
        if not self.opens(connection):
            self.not_observable("the testee did not open good memory")

    def next_frame(self, connection: Connection) -> Json:
        """The `frame` that lends the next image, once none is lent any more [IMG-2]."""
        self._takes_back(connection)
        return self.role.next_frame(connection)

    def lend(self, connection: Connection, **changes: object) -> int:
        """Send it, with members changed as named; its `seq`."""
        self._takes_back(connection)
        return self.role.lend(connection, **changes)

    def _takes_back(self, connection: Connection) -> None:
        self.uses(lambda: not self.with_(connection).lends or connection.ended)

    def releases(self, connection: Connection, seq: int, seconds: float = EFFECT_SECONDS) -> bool:
        """Whether the testee releases this frame."""
        dealings = self.with_(connection)
        self.uses(lambda: seq in dealings.released or connection.ended, seconds)
        return seq in dealings.released

    def closes(self, connection: Connection, generation: int, *seconds: float) -> bool:
        """Whether the testee closes the memory of this generation."""
        dealings = self.with_(connection)
        self.wait(lambda: generation in dealings.closed or connection.ended, *seconds)
        return generation in dealings.closed

    def says_hello(self, connection: Connection) -> bool:
        """Whether the testee says `hello` on this connection."""
        return self._answers(lambda: self.with_(connection).hello)

    def arrives(self, channel: Channel, seconds: float, after: int = 0) -> bool:
        """Whether there are more than `after` connections on this channel in time."""
        return self.wait(
            lambda: sum(c.channel == channel for c in self.peer.connections) > after, seconds
        )

    # Scripts, and what becomes of them

    def outcome_on_ipc(self, connection: Connection, *scripts: bytes) -> str:
        """Deliver scripts on a greeted IPC connection, then a good init packet as the control.

        Returns `ignores` (the good packet was opened), `declines` or `accepts` (one that the
        scripts announced), `refuses` (the good packet), `closes` (and came back), `exits`, `dies`
        or `hangs`.
        """
        dealings = self.with_(connection)
        heard = len(dealings.heard)
        for script in scripts:
            connection.send(script)
        # A client without reinit may ignore the good packet for a further one (OPN-6).
        further = self._takes_further(connection)
        good = packet(encode(self.role.init_packet(connection)))
        generation = dealings.generation
        connection.send(good)

        def reacts() -> bool:
            return generation in dealings.opened | dealings.failed or connection.ended is not None

        in_time = self.wait(reacts, EFFECT_SECONDS if further else REACTION_SECONDS)
        if further and not in_time:
            # To close late is to hang; to open late is to be busy, and no sentence limits that.
            self.wait(lambda: reacts() or self.fate(), self.patience)
            if connection.ended and not self.wait(lambda: self.fate(), 0.05):
                return "hangs"
        answers = {
            str(message.get("type"))
            for message in dealings.heard[heard:]
            if message.get("generation") != generation
        }
        if "opened" in answers:
            return "accepts"
        outcome = "declines" if "open_failed" in answers else "ignores"
        if generation in dealings.opened:
            self.controls += 1
            return outcome
        if generation in dealings.failed:
            return "refuses"
        if connection.ended or further or self.fate():
            return self._end_of(connection)
        return outcome if self.comes_back("ipc") else self.fate() or "hangs"

    def outcome_on_msg(self, connection: Connection, *scripts: bytes) -> str:
        """What the testee does after what it was sent on the message channel, as above."""
        for script in scripts:
            connection.send(script)
        before = len(connection.messages)
        self.wait(
            lambda: len(connection.messages) > before + 1 or connection.ended,
            1.0 if self.facts.poses else REACTION_SECONDS,
        )
        if not connection.ended and len(connection.messages) > before + 1:
            self.controls += 1
            return "ignores"
        if not connection.ended and self.fate() is None:
            return "ignores" if self.comes_back("msg") else self.fate() or "hangs"
        return self._end_of(connection)

    def comes_back(self, channel: Channel) -> bool:
        """Whether the testee connects to this channel again and says something that it means.

        A client that speaks 1.0 has nothing to say on the IPC channel. One that never comes back
        has gone on if it closed the connection, and lives or left as it does; else nobody knows.
        """
        if channel not in self.facts.returns:
            self._expect_closed(channel)
            return self.fate() is None or (self.fate() == "exits" and self.facts.leaves)
        return self.tries_to_go_on(channel)[1]

    def _end_of(self, connection: Connection) -> str:
        outcome = self.end_of(connection, 0.05)
        if outcome == "closes" and connection.channel not in self.facts.returns and not self.fate():
            self._expect_closed(connection.channel)
        return outcome

    def end_of(self, connection: Connection, seconds: float = EFFECT_SECONDS) -> str:
        """What becomes of a connection that is to end within this time: `closes` (and, where it is
        known to, the testee comes back), `exits`, `dies` or `hangs`.

        To end in an orderly way closes too, and may be seen before its connection is.
        """
        self.ends(connection, seconds)
        self.wait(self.fate, REACTION_SECONDS if connection.ended else 0.0)
        returns = connection.channel in self.facts.returns
        if self.fate() == "exits" and connection.ended and (self.facts.leaves or not returns):
            self.controls += 1
            return "closes"
        if fate := self.fate():
            return fate
        if not connection.ended:
            return "hangs"
        if not returns:
            self.controls += 1
            return "closes"
        return "closes" if self.comes_back(connection.channel) else self.fate() or "hangs"

    def _expect_closed(self, channel: Channel) -> None:
        """A testee that never comes back shows by closing, and living on, that it goes on."""
        on_it = [c for c in self.peer.connections if c.channel == channel and c in self._used]
        if not (self.testee.expendable and on_it and on_it[-1].ended):
            self.not_observable(
                f"the testee is not known to come back to the {channel} channel: one that goes on "
                "there and one that does not look alike"
            )
        self.controls += 1

    def _takes_further(self, connection: Connection) -> bool:
        return "reinit" in self.with_(connection).granted

    def _takes_another(self, connection: Connection) -> bool:
        dealings = self.with_(connection)
        first = dealings.welcome is not None and not dealings.generation
        return first or self._takes_further(connection)
