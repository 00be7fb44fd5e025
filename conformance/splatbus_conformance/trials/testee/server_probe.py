"""The first meeting with a server: what it does when a friendly client comes.

Checks ask no more of it than it has shown here.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from splatbus_conformance.images.captured import CapturedFrame, photograph_of, shows_the_scene
from splatbus_conformance.images.known_scene import SceneState
from splatbus_conformance.images.pinhole import ObjectPlacement, placed_in
from splatbus_conformance.plan import NoVerdict
from splatbus_conformance.rules.v1_0.ini import size
from splatbus_conformance.trials.scripted_client import DialledConnection, ScriptedClient
from splatbus_conformance.trials.testee import diagnostics, probe_advice
from splatbus_conformance.trials.testee.facts import Facts
from splatbus_conformance.trials.testee.process import Testee, not_met
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.json_values import finite, finites, texts, within
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import CHANNELS, DIAL_SECONDS, Connection, Peer

REPLY_SECONDS = 2.0
AT_ONCE_SECONDS = 0.5
GONE_SECONDS = 0.05
"""Until a server has noticed that a connection was closed, and has room for the next."""
FRAME_SECONDS = 5.0
PLAYING_SECONDS = 0.5
WHOLE_SECONDS = 0.1
"""Time for the first image to be whole, should it not be when its frame comes (IMG-6)."""
DEFAULT, BALL = "default", "ball"
"""The objects of `conformance/SCENE.md`, if it has two."""
AN_ID = 7
"""Of the request by which it is told whether replies repeat ids, as they do from 1.1 on."""


@dataclass
class ServerFacts(Facts):
    """What the server showed of itself when it was first met."""

    listens: dict[Channel, bool] = field(default_factory=lambda: dict.fromkeys(CHANNELS, True))
    """It accepts connections on that channel."""
    alone: dict[Channel, bool] = field(default_factory=lambda: dict.fromkeys(CHANNELS, False))
    """It serves one connection at a time on that channel: of two, one is closed or not answered."""
    welcome: dict[Channel, Json | None] = field(default_factory=lambda: {"ipc": None, "msg": None})
    answers: bool = False
    """It answered a request for the size."""
    repeats_ids: bool = True
    """So did one with an `id`, with that, where it was asked with one (NEG-28)."""
    init_packet: Json | None = None
    """The first that a client of 1.1 was sent, or else a client of 1.0."""
    at_once: bool = False
    """It sends an init packet before anybody has said `hello`: its images are in CUDA memory."""
    opens: bool = False
    """Its images can be opened here."""
    renders: bool = False
    """It sent a `frame`."""
    first: CapturedFrame | None = None
    """The image that it showed before anybody had posed anything."""
    scene_known: bool = False
    """That image is of the scene of `conformance/SCENE.md`."""
    scene: Json | None = None
    """The reply to `get_scene`."""
    waited_for: float = 0.0
    """For how long it has to be waited for, now and then: its start, or an image."""
    plays: bool = False
    """The time of its scene goes by until a client sets it."""
    errs: bool = False
    """It answered a `hello` by an `error` that only who speaks 1.1 has."""
    unauthorized: bool = False
    """It requires a token that it was not given."""
    guarded: bool = False
    """It requires the token that it was given."""
    size: tuple[int, int] = (0, 0)

    def __str__(self) -> str:
        """What it did when friendly clients came."""
        where = " and ".join(WORDS[it] for it in CHANNELS if self.listens[it])
        parts = [f"it speaks {self.version()}", f"listens on {where}"]
        if self.unauthorized:
            parts.append("asks for a token that it was not given: put it into SPLATBUS_TOKEN")
        if self.guarded:
            parts.append("requires the token that it was given")
        if self.size != (0, 0):
            parts.append(f"announces images of {self.size[0]}x{self.size[1]}")
        parts.append("sends frames" if self.renders else "sends no frame")
        if self.scene_known:
            parts.append("shows the scene that the harness knows")
        return ", ".join(parts)

    def version(self) -> str:
        """The newest version that it speaks: it is judged by that."""
        return "1.1" if any(self.welcome.values()) or self.errs else "1.0"

    def capabilities(self, channel: Channel = "ipc") -> list[str]:
        """What it granted on a channel to a client that offered everything."""
        return texts(within(self.welcome[channel], "capabilities"))

    def grants(self, capability: str) -> bool:
        """Whether it granted this on either channel."""
        return any(capability in self.capabilities(channel) for channel in CHANNELS)

    def objects(self) -> list[str]:
        """The ids of the objects that `scene` lists; `default` where it tells nothing."""
        listed = within(self.scene, "objects")
        ids = [within(it, "id") for it in listed] if isinstance(listed, list) else []
        return texts(ids) or [DEFAULT]

    def time_range(self) -> tuple[float, float] | None:
        """First and last time of the scene, if it is animated."""
        told = finites(within(self.scene, "timeRange"), 2)
        return (told[0], told[1]) if told else None

    def setting(
        self,
        frame: Json,
        default: ObjectPlacement | None = None,
        ball: ObjectPlacement | None = None,
    ) -> SceneState:
        """How the known scene is to look in an image with its objects here, or where its frame says
        that they are: whoever moved them last may be gone, and they stay (CTL-5).
        """
        seconds = (finite(frame.get("time")) if self.time_range() else None) or 0.0
        return SceneState(
            default or placed_in(frame, DEFAULT),
            (ball or placed_in(frame, BALL)) if BALL in self.objects() else None,
            seconds,
        )

    def at_once_is_late(self) -> bool:
        """No init packet came at once, from one who has nothing else to say there: a busy machine
        makes this too, so it is waited for once more, and longer.
        """
        if self.at_once or self.guarded or self.unauthorized:
            return False
        lent = within(within(self.init_packet, "memory"), "kind")
        return self.welcome["ipc"] is None or lent == "cuda_ipc"

    def lacks(self, need: str) -> str | None:
        """Why a check that needs this can show nothing, or None if it can."""
        kind, _, of = need.partition(":")
        if kind in ("stand-in", "device"):
            return self.device_lacks(kind)
        known, why = NEEDS[kind](self, of)
        return None if known else f"the server {why}"


NEEDS: dict[str, Callable[[ServerFacts, str], tuple[bool, str]]] = {
    "1.1": lambda it, _: (it.version() == "1.1", "speaks 1.0 only"),
    "capability": lambda it, of: (it.grants(of), f"does not grant the capability {of}"),
    "opens": lambda it, _: (it.opens, "announces no memory that can be opened here"),
    "frames": lambda it, _: (it.renders, "sent no frame"),
    "pixels": lambda it, _: (
        (False, "shows a scene that plays, and nobody may set its time")
        if it.plays and "time" not in it.capabilities("msg")
        else (it.first is not None, "shows no image that can be read here")
    ),
    "scene": lambda it, _: (it.scene_known, "does not show the scene of conformance/SCENE.md"),
    "cuda": lambda it, _: (
        (False, "requires a token, and announces nothing to who says nothing")
        if it.guarded
        else (it.at_once, "announces no CUDA memory")
    ),
}
"""Of each need but a device's: whether it is met, and what is the case if not."""


def introduce(peer: Peer, viewer: ScriptedClient, testee: Testee, patience: float) -> ServerFacts:
    """Meet the server as a well-behaved client of 1.0, then of 1.1.

    Raises NoVerdict if it accepts no connections on either channel within `patience` seconds.
    """
    peer.clear()
    peer.on_open, peer.on_message = viewer.on_open, viewer.on_message
    testee.ensure_running()
    facts = ServerFacts()
    old = {channel: reach(peer, testee, channel, patience) for channel in CHANNELS}
    facts.listens = {channel: connection is not None for channel, connection in old.items()}
    facts.waited_for = time.monotonic() - testee.started if testee.started else 0.0
    if not any(facts.listens.values()):
        where = " and ".join(_refusal(peer, channel) for channel in CHANNELS)
        raise not_met(testee, "server", where, peer.host, patience)
    if (old_msg := old["msg"]) is not None:
        viewer.say(old_msg, {"type": "get_viewport_size"})
        peer.until(lambda: old_msg.messages or old_msg.ended or testee.ended(), REPLY_SECONDS)
        facts.answers = bool(old_msg.messages)
    if (old_ipc := old["ipc"]) is not None:
        peer.until(lambda: old_ipc.messages or testee.ended(), AT_ONCE_SECONDS)
        facts.init_packet = next(iter(viewer.with_(old_ipc).init_packets), None)
        facts.at_once = facts.init_packet is not None
    peer.close_all()
    peer.pump(GONE_SECONDS)
    for channel in (channel for channel in CHANNELS if facts.listens[channel]):
        if (connection := reach(peer, testee, channel, patience)) is not None:
            _greet(connection, peer, viewer, facts)
    facts.guarded = any(facts.welcome.values()) and _guards(peer, viewer, testee, patience)
    if facts.listens["ipc"] and facts.at_once_is_late():
        later = reach(peer, testee, "ipc", patience)
        peer.until(lambda: later is None or later.ended or later.messages, FRAME_SECONDS)
        told = viewer.with_(later).init_packets if later is not None else []
        facts.at_once = bool(told)
        facts.init_packet = facts.init_packet or next(iter(told), None)
    facts.plays = _plays(peer, viewer, facts)
    if facts.first is not None:
        facts.scene_known = shows_the_scene(facts.first, facts.setting(facts.first.frame))
    is_open = viewer.token is not None and any(facts.welcome.values()) and not facts.guarded
    is_blank = "frames" in facts.capabilities("ipc") and facts.init_packet is None
    met = [probe_advice.observed(it, it.testee_port) for it in peer.connections]
    facts.advice = probe_advice.on_server(met, is_open, is_blank)
    facts.size = size(within(facts.init_packet, "meta")) or (0, 0)
    peer.close_all()
    peer.pump(GONE_SECONDS)
    for channel in (channel for channel in CHANNELS if facts.listens[channel]):
        facts.alone[channel] = _serves_one(channel, peer, viewer, testee, facts, patience)
    peer.close_all()
    ended = testee.ended()
    if ended and not (facts.answers or facts.init_packet or any(facts.welcome.values())):
        raise NoVerdict(diagnostics.ended_by_itself(f"the server {ended}", testee.output()))
    return facts


def _greet(connection: Connection, peer: Peer, viewer: ScriptedClient, facts: ServerFacts) -> None:
    """Say hello, as a client of 1.1, and then use what is granted."""
    dealings, channel = viewer.with_(connection), connection.channel
    dealings.holds = True
    viewer.greet(connection)
    peer.until(lambda: dealings.welcome or connection.ended, REPLY_SECONDS)
    facts.welcome[channel] = dealings.welcome
    facts.unauthorized |= "unauthorized" in dealings.errors()
    facts.errs |= any(map(_is_of_1_1, dealings.heard))
    if channel == "ipc" and dealings.welcome:
        began = time.monotonic()
        peer.until(lambda: dealings.frames or connection.ended, FRAME_SECONDS)
        facts.waited_for = max(facts.waited_for, time.monotonic() - began)
        peer.pump(WHOLE_SECONDS)
        facts.first = _first(dealings)
        facts.init_packet = next(iter(dealings.init_packets), facts.init_packet)
        facts.opens = dealings.memory is not None
        facts.renders = bool(dealings.frames)
    if channel == "msg" and dealings.welcome:
        said = len(dealings.heard)
        viewer.say(connection, {"type": "get_viewport_size", "id": AN_ID})
        peer.until(lambda: len(dealings.heard) > said or connection.ended, REPLY_SECONDS)
        facts.answers |= len(dealings.heard) > said
        facts.repeats_ids = any(it.get("id") == AN_ID for it in dealings.heard[said:])
    if channel == "msg" and "scene" in dealings.granted:
        viewer.say(connection, {"type": "get_scene"})
        peer.until(lambda: _scene(dealings) or connection.ended, REPLY_SECONDS)
        facts.scene = _scene(dealings)


def _serves_one(
    channel: Channel,
    peer: Peer,
    viewer: ScriptedClient,
    testee: Testee,
    facts: ServerFacts,
    patience: float,
) -> bool:
    """Whether, of two connections on a channel, one is closed, or is not answered while the other
    is there; a further one may be kept waiting before it is closed (CHN-13).
    """
    pair = [it for _ in range(2) if (it := reach(peer, testee, channel, patience))]
    if channel == "msg" and facts.answers:
        for connection in pair:
            if facts.guarded:
                viewer.greet(connection, capabilities=[])
            viewer.say(connection, {"type": "get_viewport_size"})
        most = 1 + facts.guarded
        peer.until(
            lambda: any(it.ended for it in pair) or all(len(it.messages) >= most for it in pair),
            EFFECT_SECONDS,
        )
        answered = [len(it.messages) >= most for it in pair]
        return any(it.ended for it in pair) or (any(answered) and not all(answered))
    peer.pump(GONE_SECONDS)
    return any(it.ended for it in pair)


def _guards(peer: Peer, viewer: ScriptedClient, testee: Testee, patience: float) -> bool:
    """Whether the server requires the token that it was given."""
    if viewer.token is None:
        return False

    def refuses(connection: Connection | None) -> bool:
        if connection is None:
            return False
        viewer.greet(connection, token=None)
        heard = viewer.with_(connection)
        peer.until(lambda: heard.heard or connection.ended, REPLY_SECONDS)
        return "unauthorized" in heard.errors()

    return any(refuses(reach(peer, testee, channel, patience)) for channel in CHANNELS)


def reach(peer: Peer, testee: Testee, channel: Channel, seconds: float) -> Connection | None:
    """A new connection, tried again until the server listens, for so many seconds from its start;
    once it did, it has no longer than it may let a client wait (CHN-13).
    """
    found: list[Connection] = []
    if testee.expendable:
        listens = peer.last_opened[channel] > testee.started
        left = 0.0 if listens else testee.started + seconds - time.monotonic()
        seconds = min(seconds, max(EFFECT_SECONDS, left))

    def tried() -> bool:
        try:
            found.append(peer.dial(channel, min(DIAL_SECONDS, seconds)))
        except OSError:
            return testee.ended() is not None
        return True

    peer.until(tried, seconds)
    return found[0] if found else None


def _is_of_1_1(message: Json) -> bool:
    """An error of who speaks 1.1, which 1.0 has none of; a later version would not list it."""
    is_other = message.get("code") == "unsupported_version"
    return message.get("type") == "error" and not (
        is_other and "1.1" not in texts(message.get("supported"))
    )


def _first(dealings: DialledConnection) -> CapturedFrame | None:
    if dealings.memory is None or not dealings.frames:
        return None
    return photograph_of(dealings.frames[0], dealings.memory, dealings.init_packets[-1])


def _plays(peer: Peer, viewer: ScriptedClient, facts: ServerFacts) -> bool:
    """Whether an image of another time comes to who holds the first one, and gives it back."""
    readers = [it for it in peer.connections if viewer.with_(it).held]
    if not readers or facts.first is None or (facts.scene and facts.time_range() is None):
        return False
    frames = viewer.with_(readers[-1]).frames
    viewer.release(readers[-1], frames[-1])
    peer.until(lambda: frames[1:] or readers[-1].ended, PLAYING_SECONDS)
    return frames[-1].get("time") != facts.first.frame.get("time")


def _scene(dealings: DialledConnection) -> Json | None:
    return next((said for said in dealings.heard if said.get("type") == "scene"), None)


def _refusal(peer: Peer, channel: Channel) -> str:
    """An address, and what is said there."""
    address = f"{channel} {peer.host}:{peer.ports[channel]}"
    try:
        peer.dial(channel, REPLY_SECONDS).close()
    except OSError as error:
        return f"{address} ({error.strerror or error})"
    return address
