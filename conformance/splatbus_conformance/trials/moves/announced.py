"""What a server does with the device memory that it announces, as the stand-in's calls tell."""

from collections.abc import Iterable
from typing import NamedTuple

from splatbus_conformance.images.memory.cuda_stand_in import publishing
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import JITTER_SECONDS
from splatbus_conformance.wire.json_values import texts, within
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection


class AnnouncedConnection(NamedTuple):
    """An IPC connection that was sent an init packet."""

    connection: Connection
    packet: Json
    names: dict[str, str]
    """What its handles name, by their place."""
    process: int
    """That exported them."""


def announced(trial: ServerTrial, connection: Connection | None = None) -> AnnouncedConnection:
    """A new IPC connection, or this one, once its init packet has come."""
    connection = connection or trial.dial("ipc")
    dealings = trial.with_(connection)
    trial.wait(lambda: dealings.init_packets or connection.ended)
    if not dealings.init_packets:
        trial.not_observable("the server sent no init packet")
    packet = dealings.init_packets[0]
    ring = texts(within(packet, "ring", "events"))
    handles = {name: packet.get(name) for name in ("mem_color", "mem_depth", "evt_done")}
    handles |= {"memory.handle": within(packet, "memory", "handle")}
    handles |= {f"ring.events[{i}]": event for i, event in enumerate(ring)}
    known = {place: publishing.named(handle) for place, handle in handles.items()}
    processes = {of.process for of in known.values() if of}
    names = {place: of.name for place, of in known.items() if of}
    return AnnouncedConnection(connection, packet, names, max(processes, default=0))


def calls_of(trial: ServerTrial, process: int | None = None) -> list[Call]:
    """What the server has called since it was launched, in that process or all."""
    assert trial.stand_in is not None, "a check of device memory needs the stand-in"
    return [call for call in trial.stand_in.calls() if process in (None, call.process)]


def expect_kept(trial: ServerTrial, shown: AnnouncedConnection, places: Iterable[str] = ()) -> None:
    """Nothing of what the handles in these places name, or in all, was freed."""
    names = [name for place, name in shown.names.items() if not places or place in places]
    call = publishing.freed(calls_of(trial), names, shown.process)
    if call is None:
        return
    trial.rest(JITTER_SECONDS)
    if shown.connection.ended and not trial.fate():
        trial.not_observable("the server ends a connection in favour of a later one")
    trial.violated(
        "freed-too-early",
        f"while an IPC connection was open that was sent the handles it called {call}",
    )
