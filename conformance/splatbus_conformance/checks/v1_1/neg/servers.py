"""Checks on how a server answers `hello` (spec 1.1 sections 2.1 to 2.3)."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.exchanges.exchange import STRANGER
from splatbus_conformance.trials.moves.frame_readers import joined
from splatbus_conformance.trials.moves.image_session import errors_after
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import show, strings, within
from splatbus_conformance.wire.message_kinds import CAPABILITIES, CLIENT_1_0, CLIENT_1_1
from splatbus_conformance.wire.messages import Json, camera_pose, encode, intrinsics
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

VERSIONS = ("1.1", "1.0")
MOST_CHARS: int = LIMITS["max_name_chars"]
DENIALS = {"unknown_type", "unsupported"}
"""What a server says of a message whose type, or whose capability, it does not have."""
ON_IPC, ON_MSG = CAPABILITIES["ipc"], CAPABILITIES["msg"]
CHANNEL = st.sampled_from(CHANNELS)
UNSPOKEN = st.builds("{}.{}".format, st.integers(4000, 10**30), st.integers(0, 10**30))
"""Versions that nobody speaks yet."""
CLIENTS = tuple(
    {"name": text, "version": text} for text in ("", "v", "n" * MOST_CHARS, "🙂" * MOST_CHARS)
)
LETTERS = "abcdefghijklmnopqrstuvwxyz_"
CHARACTERS = LETTERS + "AZ09 .-/\\\"'{}\x00\x1f\x7f\xa0\u00e9\u03a9\u4e2d\u202e\uffff\U0001f642"
"""Of one to four bytes each, and such that need an escape."""


def offers() -> list[tuple[Channel, tuple[str, ...]]]:
    """Every set of the IPC channel's capabilities on that channel; on the message channel every
    few and nearly all of its own, and some of the other's.
    """
    found: list[tuple[Channel, tuple[str, ...]]] = [
        ("ipc", offer) for count in range(len(ON_IPC) + 1) for offer in combinations(ON_IPC, count)
    ]
    for count in (0, 1, 2, len(ON_MSG) - 1, len(ON_MSG)):
        found += [("msg", offer) for offer in combinations(ON_MSG, count)]
    return [*found, ("ipc", (*ON_IPC, *ON_MSG)), ("msg", (*ON_IPC, *ON_MSG)), ("msg", ON_IPC)]


def spoken(trial: ServerTrial) -> list[str]:
    """The versions that the server welcomes when nothing else is offered."""
    return [version for version in VERSIONS if named(trial, "msg", [version]) == version]


def named(trial: ServerTrial, channel: Channel, versions: list[str], **more: object) -> object:
    """The version that `welcome` names after a hello that lists these; None without `welcome`."""
    connection, answer = trial.answered(channel, versions=versions, **more)
    connection.close()
    return (answer or {}).get("version")


@check("NEG-6", observable="the version that welcome names, for many lists", on={SERVER: ("1.1",)})
def check_names_the_first_version_that_it_speaks(trial: ServerTrial) -> None:
    """Lists of up to 16 versions, of which the server speaks one or two, in any order; of clients
    whose names have no character, or as many as they may.
    """
    speaks = spoken(trial)
    if not speaks:
        trial.not_observable("the server answers no hello")
    strangers = st.lists(UNSPOKEN, max_size=LIMITS["max_versions"] - len(VERSIONS))
    known = st.lists(st.sampled_from(speaks), min_size=1, unique=True)
    lists = st.tuples(known, strangers).flatmap(lambda both: st.permutations(both[0] + both[1]))
    drawn = st.tuples(CHANNEL, lists)
    most = [f"4000.{number}" for number in range(LIMITS["max_versions"] - 1)]
    listed: list[tuple[Channel, list[str]]] = [(it, [*most, speaks[0]]) for it in CHANNELS]
    for number, (channel, versions) in enumerate(trial.each(listed, drawn, quick=25, full=1000)):
        first = next(version for version in versions if version in speaks)
        client = CLIENTS[number % len(CLIENTS)]
        found = named(trial, channel, versions, client=client)
        what = f"{channel}: of {', '.join(versions)[:80]} it speaks {first} first"
        what += f" to {show(client)}"
        trial.expect(found is not None, "no-welcome", f"{what}, and it sent no welcome")
        trial.expect(found == first, "another-version", f"{what}, and welcome names {found}")
        trial.delivered += 1


def unasked(trial: ServerTrial) -> Cases:
    """What may come before hello, where it need not come first."""
    found: list[tuple[Channel, Json]] = [("ipc", STRANGER), ("msg", STRANGER)]
    found += [("msg", VIEWPORT_REQUEST), ("msg", camera_pose())]
    return Cases(found if trial.viewer.token is None else found[:1])


@check("NEG-6", observable="the welcome after other messages", on={SERVER: ("1.1",)}, cases=unasked)
def check_answers_a_hello_that_comes_late(trial: ServerTrial, case: tuple[Channel, Json]) -> None:
    """Something else comes before `hello`: what is answered, and what is ignored."""
    channel, message = case
    connection = trial.before_hello(channel)
    trial.viewer.say(connection, message)
    trial.viewer.greet(connection)
    what = f"{channel}: a hello behind a message of type {message['type']}"
    trial.expect(trial.is_welcomed(connection), "no-welcome", f"{what} had no welcome")
    connection.close()
    trial.delivered += 1


@check(
    "NEG-7", observable="the capabilities of welcome, for every set offered", on={SERVER: ("1.1",)}
)
def check_grants_what_both_have(trial: ServerTrial) -> None:
    """Offers everything first; what is granted then is what the server has."""
    has = {channel: granted(trial, channel, CAPABILITIES[channel]) for channel in CHANNELS}
    for channel, offer in trial.each(listed=offers()):
        found, both = granted(trial, channel, offer), has[channel] & set(offer)
        trial.expect(
            found == both,
            "other-capabilities",
            f"{channel}: it has {listing(has[channel])}, was offered {listing(offer)}, and "
            f"granted {listing(found)}",
        )
        trial.delivered += 1


@check("NEG-7", observable="the errors after what belongs to a capability", on={SERVER: ("1.1",)})
def check_has_what_it_grants(trial: ServerTrial) -> None:
    """A valid message of each capability that `welcome` lists: none may be refused because its type
    were not known, or its capability not agreed upon. That images cannot have a size may be said.
    """
    client = trial.commanding()
    messages = _belonging(trial)
    for name in trial.each([it for it in trial.viewer.with_(client).granted if it in messages]):
        reported, answered = errors_after(trial, client, encode(messages[name]))
        told = f"it grants {name}, and after {show(messages[name])} came no reply"
        trial.expect(answered, "no-reply", told)
        codes = {str(it.get("code")) for it in reported}
        denied = codes & (DENIALS - {"unsupported"} if name == "viewport" else DENIALS)
        trial.expect(
            not denied, "denied", f"it grants {name}, and says {listing(denied)} of its message"
        )
    if "subscribe" not in trial.facts.capabilities() or not trial.facts.opens:
        return
    reader = trial.reading()
    errors = trial.viewer.with_(reader).errors
    script = packet(encode({"type": "subscribe", "channels": ["color", "depth"]}))
    outcome = trial.outcome_on_ipc(reader, script)
    denied = DENIALS & set(errors())
    trial.expect(not denied, "denied", f"it grants subscribe, and says {listing(denied)} of that")
    trial.expect(
        outcome == "ignores", "not-ignored", f"it grants subscribe, and of that it {outcome}"
    )


def _belonging(trial: ServerTrial) -> dict[str, Json]:
    """A valid message of each capability of the message channel, which changes little."""
    width, height = trial.facts.size
    known = width and height
    sized = {"type": "set_viewport", "width": width, "height": height, "id": 1}
    lens = camera_pose() | {"intrinsics": intrinsics(width, height)}
    return {
        "objects": camera_pose(kind="object_pose") | {"object": DEFAULT},
        "scene": {"type": "get_scene", "id": 2},
        "time": {"type": "set_time", "time": 0},
        "ping": {"type": "ping", "t": 0.5, "id": 3},
        "telemetry": {"type": "subscribe_telemetry", "names": []},
    } | ({"intrinsics": lens, "viewport": sized} if known else {})


def granted(trial: ServerTrial, channel: Channel, offer: Sequence[str]) -> set[str]:
    """The capabilities of `welcome` after a hello that lists these."""
    connection, answer = trial.answered(channel, capabilities=list(offer))
    welcomed, offered = (answer or {}).get("type") == "welcome", shorten(listing(offer))
    trial.expect(welcomed, "no-welcome", f"{channel}: a hello that offers {offered} got no welcome")
    connection.close()
    return set(trial.viewer.with_(connection).granted)


def listing(names: object) -> str:
    """Names in words."""
    return ", ".join(sorted(names)) or "nothing"  # type: ignore[call-overload]


@check(
    "NEG-8", observable="welcome and images are as without the unknown ones", on={SERVER: ("1.1",)}
)
def check_ignores_unknown_capabilities(trial: ServerTrial) -> None:
    """`hello` lists capabilities of another time among the real ones, up to 64 in all."""
    offered = trial.viewer.capabilities["ipc"]
    most, longest = LIMITS["max_capabilities"], LIMITS["max_name_chars"]
    unknown = st.text(CHARACTERS, max_size=longest).filter(lambda name: name not in ON_IPC)
    names = st.lists(unknown, min_size=1, max_size=most - len(offered), unique=True)
    orders = names.flatmap(lambda strange: st.permutations([*strange, *offered]))
    all_there_may_be = [f"later {number}" for number in range(most - len(offered))] + [*offered]
    for capabilities in trial.each([all_there_may_be], orders, quick=10, full=500):
        what = f"a hello that lists {len(capabilities) - len(offered)} unknown capabilities"
        found = granted(trial, "ipc", capabilities)
        trial.expect(
            found == set(trial.facts.capabilities()),
            "other-capabilities",
            f"{what} was given {listing(found)}",
        )
        connection = trial.ready("ipc", capabilities=capabilities)
        outcome = trial.outcome(connection)
        trial.judge("accepts" if outcome == "ignores" else outcome, what)
        connection.close()


@check(
    "NEG-9", observable="the server goes on after messages of unknown types", on={SERVER: ("1.1",)}
)
def check_ignores_unknown_types(trial: ServerTrial) -> None:
    """Messages of types that nobody knows, after `hello` on either channel."""
    names = st.text(LETTERS, min_size=12, max_size=30) | st.text(CHARACTERS, max_size=100).filter(
        lambda name: name not in (*CLIENT_1_0, *CLIENT_1_1)
    )
    values = st.dictionaries(names, st.none() | st.integers(0, 9) | names, max_size=4)
    messages = st.builds(lambda kind, rest: {**rest, "type": kind}, names, values)
    ready: dict[Channel, Connection] = {}
    listed: list[tuple[Channel, Json]] = [
        *((channel, {"type": kind}) for channel in CHANNELS for kind in NO_TYPES),
        *(("ipc", message) for message in (*OF_MSG, camera_pose())),
        *(("msg", message) for message in OF_IPC),
    ]
    drawn = st.tuples(CHANNEL, messages)
    for channel, message in trial.each(listed, drawn, quick=30, full=1500):
        if channel not in ready or ready[channel].ended:
            ready[channel] = trial.ready(channel)
        outcome = trial.outcome(ready[channel], packet(encode(message)))
        kind = shorten(repr(message["type"]))
        trial.judge(outcome, f"a message of type {kind} on the {channel} channel")


NO_TYPES: tuple[Any, ...] = (
    *(None, 5, [], ["get_viewport_size"], {}, {"type": "ping"}),
    *("t" * 10_000, "🙂" * 2000),
)
OF_MSG: tuple[Json, ...] = (
    {"type": "get_viewport_size"},
    {"type": "get_camera_pose", "cam_idx": 0},
    {"type": "ping", "t": 0},
)
OF_IPC: tuple[Json, ...] = (
    *({"type": kind, "generation": 1} for kind in ("opened", "closed")),
    {"type": "open_failed", "generation": 1, "reason": "none"},
    {"type": "release", "generation": 1, "seq": 0},
)
"""Of the other channel: on this one their type is not known."""


def refused(
    trial: ServerTrial, channel: Channel, code: str, what: str, **changes: object
) -> tuple[Connection, Json]:
    """A connection whose hello, with members changed as named, has to be answered by an error of
    this code; and that error.
    """
    connection, answer = trial.answered(channel, **changes)
    told = answer or {}
    got = told.get("code", told.get("type", "no error"))
    unlike = "another-answer" if answer else "no-reply"
    trial.expect(got == code, unlike, f"{what} got {show(got)}, not {code}")
    return connection, told


@check("NEG-10", observable="the error, and the end of the connection", on={SERVER: ("1.1",)})
def check_refuses_unknown_versions(trial: ServerTrial) -> None:
    """Lists of versions that nobody speaks yet."""
    lists = st.lists(UNSPOKEN, min_size=1, max_size=LIMITS["max_versions"])
    speaks = set(spoken(trial))
    for channel, versions in trial.each(drawn=st.tuples(CHANNEL, lists), quick=10, full=500):
        what = f"{channel}: a hello that lists {', '.join(versions)[:60]}"
        connection, told = refused(trial, channel, "unsupported_version", what, versions=versions)
        listed = strings(told.get("supported")) or []
        trial.expect(listed, "no-versions", f"{what} was not told what is supported")
        unlisted = speaks - set(listed)
        trial.expect(
            not unlisted,
            "version-left-out",
            f"{what} was not told of {listing(unlisted)}, which it speaks",
        )
        trial.expect(trial.ends(connection), "not-closed", f"{what} was refused, and not closed")
        connection.close()
        trial.delivered += 1


@check("NEG-33", observable="welcome, and the replies after it", on={SERVER: ("1.1",)})
def check_speaks_1_0_to_who_asked_for_it(trial: ServerTrial) -> None:
    """A client that offers everything, and speaks 1.0 alone: what follows is as without `hello`."""
    for channel in trial.each(CHANNELS):
        everything = list(CAPABILITIES[channel])
        connection, answer = trial.answered(channel, versions=["1.0"], capabilities=everything)
        if (answer or {}).get("code") == "unsupported_version":
            trial.not_observable("the server does not speak 1.0")
        welcomed = answer is not None and answer["type"] == "welcome"
        trial.expect(
            welcomed,
            "no-welcome",
            f"{channel}: a hello that lists 1.0 was answered by {show(answer)}",
        )
        listed = (answer or {}).get("capabilities")
        trial.expect(
            listed == [],
            "other-capabilities",
            f"{channel}: welcome names 1.0 and lists {show(listed)}",
        )
        heard = trial.viewer.with_(connection).heard
        if channel == "msg":
            if not trial.facts.alone["msg"]:
                trial.move()  # another client has control, once it is answered
                trial.answers(trial.mover())
            asked = ({"type": "get_viewport_size", "id": 5}, {"type": "ping", "t": 0})
            for message in (*asked, camera_pose() | {"tag": ""}):
                trial.viewer.say(connection, message)
            answered = trial.answers(connection)
            trial.expect(answered, "no-reply", "msg: a client that speaks 1.0 is not answered")
            trial.viewer.say(connection, camera_pose(rotation=(0.0, 0.0, 0.0, 2.0)))
            trial.answers(connection)  # or it is closed, as it may be (POS-6)
            of_1_1 = {"type", "id"}  # other members may be there, which nobody knows (JSN-7)
            replies = {"viewport_size", "position"}
            odd = [it for it in heard[1:] if not replies & set(it) or of_1_1 & set(it)]
            trial.expect(
                not odd, "newer-version", f"msg: a client that speaks 1.0 was sent {show(odd[:1])}"
            )
        else:
            trial.rest(REACTION_SECONDS)
            if not trial.facts.alone[channel]:
                joined(trial)  # the pace
            told = [it for it in heard if it != answer and "mem_color" not in it]
            trial.expect(
                not told,
                "newer-version",
                f"ipc: a client that speaks 1.0 was sent {show(told[:1])}",
            )
        connection.close()
        trial.delivered += 1


@check("NEG-11", observable="no init packet comes before it is wanted", on={SERVER: ("1.1",)})
def check_waits_for_who_can_open_its_memory(trial: ServerTrial) -> None:
    """Connections without `hello`, and with one that does not list `host_shm`."""
    memory = (trial.facts.init_packet or {}).get("memory")
    if not isinstance(memory, dict) or memory.get("kind") != "host_shm":
        trial.not_observable("the server announces no memory of the host")
    others = [name for name in ON_IPC if name not in ("host_shm", "cuda_ipc")]
    waiting = [
        ("before hello", trial.before_hello("ipc")),
        ("after a hello that lists nothing", trial.greeted("ipc", capabilities=[])),
        (f"after a hello that lists {listing(others)}", trial.greeted("ipc", capabilities=others)),
    ]
    trial.rest(REACTION_SECONDS)
    told = trial.viewer.with_(trial.ready("ipc")).init_packets  # it has had the time for it
    for moment, connection in waiting:
        packets = trial.viewer.with_(connection).init_packets
        trial.expect(not packets, "unwanted-init-packet", f"an init packet {moment}")
    trial.judge("waits", "connections that cannot open memory of the host")
    trial.delivered += len(waiting) if told else 0


@check("NEG-15", observable="the first packet on a silent connection", on={SERVER: ("1.1",)})
def check_sends_cuda_memory_at_once(trial: ServerTrial) -> None:
    """A connection on which nothing is said, to a server that announces CUDA memory."""
    greeted = trial.viewer.with_(trial.greeted("ipc", capabilities=list(ON_IPC)))
    trial.wait(lambda: greeted.init_packets)
    memory = (greeted.init_packets or [trial.facts.init_packet or {}])[0].get("memory")
    if not (trial.facts.at_once or within(memory, "kind") == "cuda_ipc"):
        trial.not_observable("the server announces no CUDA memory")
    silent = trial.viewer.with_(trial.before_hello("ipc"))
    trial.wait(lambda: silent.heard)
    trial.expect(silent.init_packets, "no-init-packet", "no init packet came before hello")
    trial.expect("version" in silent.heard[0], "no-version", "its init packet names no version")
    trial.delivered += 1
