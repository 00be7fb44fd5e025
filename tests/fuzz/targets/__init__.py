"""Every target by its name, and which modules it is to reach into."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from tests.fuzz.targets import codecs, machines, readers

Run = Callable[[bytes], None]
WIRE = ("splatbus_wire",)
HARNESS = ("splatbus_conformance",)


class Target(NamedTuple):
    """What is run, and the packages whose lines count."""

    run: Run
    packages: tuple[str, ...]


TARGETS = {
    "framing": Target(codecs.framing, WIRE),
    "client-on-ipc": Target(codecs.client_on_ipc, WIRE),
    "client-on-message": Target(codecs.client_on_message, WIRE),
    "server-on-ipc": Target(codecs.server_on_ipc, WIRE),
    "server-on-message": Target(codecs.server_on_message, WIRE),
    "server": Target(machines.server, ("splatbus_server", *WIRE)),
    "client-of-images": Target(machines.client_of_images, ("splatbus_client", *WIRE)),
    "client-of-messages": Target(machines.client_of_messages, ("splatbus_client", *WIRE)),
    "recorded": Target(readers.recorded, HARNESS),
    "reported": Target(readers.reported, (*HARNESS, "jsonschema")),
    "scripted": Target(readers.scripted, HARNESS),
    "leniently": Target(readers.leniently, (*HARNESS, *WIRE)),
    "streamed": Target(readers.streamed, HARNESS),
}
