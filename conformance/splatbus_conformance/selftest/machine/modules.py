"""The modules that are changed, and the changes that a seed draws from them."""

import hashlib
import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from splatbus_conformance.plan import SIDES, Side
from splatbus_conformance.selftest.machine.changes import Change, changes

WIRE = tuple(
    f"splatbus_wire.{name}"
    for name in (
        *("compositing", "conventions", "decoding", "depth", "encoding", "errors", "fields"),
        *("framing", "from_client", "from_server", "init_packet", "intrinsics", "json_text"),
        *("message_types", "messages", "negotiation", "parts", "plain", "plain_frames"),
        *("plain_poses", "poses", "relative", "rotations"),
    )
)
"""All of it: whatever it says is on the wire, or is computed as the standard tells."""
OWN: dict[Side, tuple[str, ...]] = {
    "client": tuple(
        f"splatbus_client.{name}"
        for name in (
            *("backoff", "channel", "clock", "events", "host_memory", "incoming", "ipc_protocol"),
            *("lease", "loop", "message_protocol", "outgoing", "questions", "reading", "session"),
            "steering",
        )
    ),
    "server": tuple(
        f"splatbus_server.{name}"
        for name in (
            *("connection", "control", "exchange", "lens", "memory", "reader", "ring", "service"),
            *("session", "shared_memory", "steering", "telemetry", "view", "viewport"),
        )
    ),
}
"""What speaks, remembers what was agreed, or holds what is lent.

Not what takes images and orders from a renderer (`api`, `publish`), draws the scene, shows images
or reads a command line, which others do in their own way and no peer sees; nor the client's
adapter, which is the harness's instrument; nor what is for CUDA or compiled, whose lines are not
executed here.
"""


@dataclass(frozen=True)
class Drawn:
    """A change, and whom it changes."""

    change: Change
    sides: tuple[Side, ...]


def draw(count: int, seed: int) -> list[Drawn]:
    """So many changes of all, drawn by seed: more of them begin with the same ones, and those of a
    function that is edited fall out without moving others.
    """
    every = [each for module in (*WIRE, *OWN["client"], *OWN["server"]) for each in of(module)]
    every.sort(key=lambda change: hashlib.blake2b(f"{seed} {change.name}".encode()).digest())
    return [as_drawn(change) for change in every[:count]]


def named(names: Iterable[str]) -> list[Drawn]:
    """Those of these changes that there still are."""
    wanted = list(names)
    there = {it.name: it for module in {name.partition(":")[0] for name in wanted}
             for it in of(module)}  # fmt: skip
    return [as_drawn(there[name]) for name in wanted if name in there]


def as_drawn(change: Change) -> Drawn:
    """With whom it changes: both where it is the wire."""
    own = tuple(side for side in SIDES if change.module in OWN[side])
    return Drawn(change, own or SIDES)


def of(module: str) -> list[Change]:
    """Every change of a module."""
    return changes(source(module).read_text("utf-8"), module)


def source(module: str) -> Path:
    """Where a module is written; it is not imported."""
    package, _, name = module.rpartition(".")
    found = importlib.util.find_spec(package)
    assert found is not None, f"there is no package {package}"
    assert found.submodule_search_locations, f"{package} is no package"
    return Path(found.submodule_search_locations[0], f"{name}.py")
