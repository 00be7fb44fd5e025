"""The smoke test of an adapter: a broken shim is told from a broken client, before any verdict."""

from typing import Any

import numpy as np
from splatbus_schemas import LIMITS

from splatbus_conformance.images import painted
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee.adapter import (
    Adapted,
    AdapterBroken,
    ClientCrashed,
    Declined,
)
from splatbus_conformance.trials.testee.process import STOP_SECONDS
from splatbus_conformance.wire.sockets import Peer

UNKNOWN = "x_splatbus_conformance"
"""A command that no version will define."""
IMAGE_SECONDS = 3.0
GIVING_UP_SECONDS: float = LIMITS["reply_seconds"]
"""How long a client may wait for a reply that it has not understood, before it closes (CHN-15)."""
IDENTITY = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
HARMLESS: dict[str, dict[str, Any]] = {
    "send_camera": IDENTITY,
    "send_object": IDENTITY,
    "init_packet": {},
    "pixels": {"at": [[0, 0]]},
    "digest": {},
    "frame": {},
    "composite": {"color": [0.0, 0.5, 1.0], "depth": 4.0, "at": [[0, 0]]},
    "subscribe": {"channels": ["color", "depth"]},
}


def smoke(adapted: Adapted, peer: Peer, role: ScriptedServer) -> None:
    """Try everything that the adapter says it can, with a well-behaved server at hand.

    Raises AdapterBroken, and OSError if the command cannot be started.
    """
    peer.clear()
    peer.on_open, peer.on_message = role.on_open, role.on_message
    for slot in range(role.slots):
        image = painted.coordinates(slot, role.width, role.height)
        painted.write(role.memory, image, slot, role.ring_layout)
    try:
        greeting = adapted.open()
        adapted.ask("start")
        peer.until(lambda: _settled(role), IMAGE_SECONDS)
        _requires_an_error(adapted)
        for command, members in HARMLESS.items():
            if command in greeting.can:
                adapted.ask(command, **members)
        if "ask" in greeting.can and any(c.channel == "msg" for c in peer.connections):
            _asks(adapted, peer, role)
        if {"pixels", "digest"} <= greeting.can:
            _digest_fits_the_pixels(adapted, role)
        if "stop" in greeting.can:
            _stops(adapted)
    except ClientCrashed as crash:
        raise AdapterBroken(f"nothing but harmless commands were given, and {crash}") from None
    finally:
        adapted.stop()
        peer.clear()


def _settled(role: ScriptedServer) -> bool:
    return any(dealings.released or dealings.failed for dealings in role.dealings.values())


def _requires_an_error(adapted: Adapted) -> None:
    adapted.give(UNKNOWN)
    answer = adapted.hear(UNKNOWN)
    if not isinstance(answer.get("error"), str):
        raise AdapterBroken(f"a command that nobody knows was not answered by an error: {answer}")


def _asks(adapted: Adapted, peer: Peer, role: ScriptedServer) -> None:
    requests = ["viewport_size", {"camera": 0}]
    try:
        replies = adapted.ask("ask", requests=requests)["replies"]
    except Declined:
        if peer.until(role.is_given_up, GIVING_UP_SECONDS):
            return  # it was answered: a client that understands no reply is judged by REQ-11
        raise
    kinds = ["width" in reply for reply in replies]
    if kinds != [True, False]:
        raise AdapterBroken(f"its replies do not answer {requests} in that order: {replies}")


def _digest_fits_the_pixels(adapted: Adapted, role: ScriptedServer) -> None:
    """Pixels that are those of an image of ours come with the digest of that image.

    What comes with others is for the checks to judge: then it is the client that reads wrongly.
    """
    width, height = role.width, role.height
    at = [[x, y] for x in {0, width // 2, width - 1} for y in {0, height // 3, height - 1}]
    digest, pixels = adapted.ask("digest"), adapted.ask("pixels", at=at)
    if digest["seq"] is None or pixels["seq"] != digest["seq"]:
        return
    for name in ("color", "depth"):
        told = pixels[name]
        if told is None or digest[name] is None:
            continue
        if len(told) != len(at):
            raise AdapterBroken(f"asked for {len(at)} pixels, it told {len(told)}")
        for slot in range(role.slots):
            image = getattr(painted.coordinates(slot, width, height), name)
            right = np.array([image[y, x] for x, y in at], np.float64)
            if np.array_equal(np.array(told, np.float64), right) and (
                digest[name] != painted.sha256(image)
            ):
                raise AdapterBroken(
                    f"its digest of {name} does not fit its pixels: at {at[0]} it tells {told[0]};"
                    f" the digest of that image is {painted.sha256(image)}, not {digest[name]}"
                )


def _stops(adapted: Adapted) -> None:
    adapted.ask("stop", STOP_SECONDS)
    ended: Any = adapted.end()
    if ended is None or ended.status != 0:
        raise AdapterBroken(f"after stop it {ended or 'went on'}, where status 0 was to come")
