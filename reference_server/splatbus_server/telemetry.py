"""What a renderer tells of itself, on its way to the clients that subscribed (1.1 annex A)."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Union

from splatbus_schemas import LIMITS
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import Series, Telemetry
from splatbus_wire.series import Reading, series

from splatbus_server.connection import Connection
from splatbus_server.statistics import Statistics

Given = Union[Reading, Callable[[], Reading]]


@dataclass
class Subscriber:
    """A client that wants telemetry.

    Attributes:
        names: of the series; None for all.
        due: what it was not sent yet, the newest of each name.
    """

    names: frozenset[str] | None
    due: dict[str, Series] = field(default_factory=dict)


class Readings:
    """The newest readings: the render loop gives them, the I/O thread passes them on."""

    def __init__(self, statistics: Statistics) -> None:
        self._statistics = statistics
        self.subscribers: dict[Connection, Subscriber] = {}
        self._wanted: frozenset[str] | None = frozenset()
        self._lock = threading.Lock()
        self._given: dict[str, Series] = {}
        self._given_at = 0.0
        self._seq = 0

    # The render loop's side

    def give(self, values: Mapping[str, Given], now: float) -> bool:
        """Takes what somebody subscribed to, and looks at nothing else [TEL-4].

        Returns whether there is something to pass on.

        Raises:
            ValueError: a reading is none that can be sent; nothing of the call is.
        """
        wanted = self._wanted
        if wanted is not None and wanted.isdisjoint(values):
            return False
        found = [
            series(name, value() if callable(value) else value)
            for name, value in values.items()
            if wanted is None or name in wanted
        ]
        self._statistics.series_computed += len(found)
        with self._lock:
            self._given.update((each.name, each) for each in found)
            self._given_at = now
        return bool(found)

    # The I/O thread's side

    def subscribe(self, connection: Connection, names: frozenset[str] | None) -> None:
        """Takes what a connection wants from now on; None for everything [TEL-1, TEL-3]."""
        self.subscribers[connection] = Subscriber(names)
        self._add_up()

    def unsubscribe(self, connection: Connection) -> None:
        """Forgets a connection."""
        if self.subscribers.pop(connection, None) is not None:
            self._add_up()

    def pass_on(self) -> None:
        """Sends one message to each who wants something new and has taken the last [TEL-5]."""
        if not self.subscribers:
            return
        with self._lock:
            given, self._given, moment = self._given, {}, self._given_at
        for connection, subscriber in self.subscribers.items():
            names, due = subscriber.names, subscriber.due
            due.update((n, each) for n, each in given.items() if names is None or n in names)
            if due and not connection.unsent and connection.is_open:
                self._send(connection, due, moment)

    def _send(self, connection: Connection, due: dict[str, Series], moment: float) -> None:
        """As many as a message holds, and a packet [FRM-2, JSN-12]; the others are due still."""
        count = min(len(due), LIMITS["max_series"])
        while True:
            names = list(due)[:count]
            try:
                connection.send(
                    Telemetry(self._seq + 1, moment, tuple(due[name] for name in names))
                )
                break
            except ProtocolError:
                if count == 1:
                    raise
                count //= 2
        for name in names:
            del due[name]
        self._seq += 1
        self._statistics.telemetry_sent += 1

    def _add_up(self) -> None:
        everyone = [subscriber.names for subscriber in self.subscribers.values()]
        named = [names for names in everyone if names is not None]
        self._wanted = frozenset().union(*named) if len(named) == len(everyone) else None
