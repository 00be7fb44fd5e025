"""The modules that are changed, and the changes that a seed draws from them."""

import hashlib
import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from splatbus_conformance.plan import SIDES, Side

from tests.zoo.machine.changes import Change, changes

WIRE = tuple(
    f"splatbus_wire.{name}"
    for name in (
        *("compositing", "conventions", "decoding", "encoding", "errors", "fields"),
        *("framing", "from_client", "from_server", "init_packet", "intrinsics"),
        *("json_bounds", "json_text"),
        *("lens", "message_types", "messages", "negotiation", "packet_reader", "parts"),
        *("plain", "plain_frames", "plain_poses", "poses", "rotations", "series"),
        "superseding",
    )
)
"""All of it that is on the wire, or that a client computes which is judged.

Not `depth` and `relative`, by which renderers store depths and lose no digits far from the origin:
the server that is judged shows a scene that it draws by itself. Their tests judge them.
"""
OWN: dict[Side, tuple[str, ...]] = {
    "client": tuple(
        f"splatbus_{name}"
        for name in (
            *("client.backoff", "client.channel", "client.events", "client.host_memory"),
            *("client.ipc_protocol", "client.lease", "client.loop"),
            *("client.message_protocol", "client.outgoing", "viewer.questions", "client.reading"),
            *("client.complaints", "client.mapping", "client.session", "client.steering"),
        )
    ),
    "server": tuple(
        f"splatbus_server.{name}"
        for name in (
            *("connection", "control", "exchange", "memory", "reader", "ring", "service"),
            *("limits", "peer", "session", "share", "shared_memory", "steering", "telemetry"),
            *("view", "viewport"),
        )
    ),
}
"""What speaks, remembers what was agreed, or holds what is lent.

Not what takes images and orders from a renderer (`api`, `publish`), draws the scene, shows images
or reads a command line, or tells by how much clocks differ (`clock`), which others do in their own
way and no peer sees; nor the client's adapter, which is the harness's instrument; nor what is for
CUDA or compiled, whose lines are not executed here.
"""
UNCALLED: dict[str, tuple[str, ...]] = {
    "splatbus_server.view": (  # matrices for renderers; that of the demo makes its own
        *("View.object_to_world", "View.pixel_errors", "View._seen_from"),
    ),
    "splatbus_wire.poses": ("world_matrix", "view_matrix", "camera_centre", "as_array"),
    "splatbus_wire.intrinsics": (  # for who projects points or reads a calibration
        *("Pinhole.project", "Pinhole.ray", "Pinhole.rays", "from_opencv"),
        *("pixel_centre", "pixel_at"),
    ),
    "splatbus_wire.rotations": ("quaternion_from_matrix", "_check_rotation"),
    "splatbus_wire.conventions": (  # for engines that give matrices; adapters give quaternions
        *("Engine.matrix_from_wire", "Engine.matrix_to_wire", "_product"),
        *("_blender_object_from_wire", "_opengl"),
    ),
}
"""Functions of these modules that are for renderers and engines, and that no program calls which is
judged: no run executes a line of them, so that what is changed there tells nothing of the harness.
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
    modules = {name.partition(":")[0] for name in wanted}
    there = {it.name: it for module in modules if source(module).exists() for it in of(module)}
    return [as_drawn(there[name]) for name in wanted if name in there]


def as_drawn(change: Change) -> Drawn:
    """With whom it changes: both where it is the wire."""
    own = tuple(side for side in SIDES if change.module in OWN[side])
    return Drawn(change, own or SIDES)


def of(module: str) -> list[Change]:
    """Every change of a module, but of what nobody calls who is judged."""
    found = _changes(source(module).read_text("utf-8"), module)
    uncalled = {f"{module}:{function}" for function in UNCALLED.get(module, ())}
    return [it for it in found if it.name.rsplit(":", 2)[0] not in uncalled]


@cache
def _changes(text: str, module: str) -> tuple[Change, ...]:
    return tuple(changes(text, module))


def source(module: str) -> Path:
    """Where a module is written; it is not imported."""
    package, _, name = module.rpartition(".")
    found = importlib.util.find_spec(package)
    assert found is not None, f"there is no package {package}"
    assert found.submodule_search_locations, f"{package} is no package"
    return Path(found.submodule_search_locations[0], f"{name}.py")
