"""Checks on `hello` and `welcome`, and what they agree upon (spec 1.1 sections 2.1 to 2.3)."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.spelling import ODD_TEXT
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.agreement import (
    CHARACTERS,
    LETTERS,
    Trial,
    agreed,
    agreeing,
    judge_agreement,
    named,
    offered,
    refused,
    unwelcome,
)
from splatbus_conformance.trials.moves.exchanges.asking import asking, requests
from splatbus_conformance.trials.moves.exchanges.exchange import STRANGER
from splatbus_conformance.trials.moves.frame_readers import joined
from splatbus_conformance.trials.moves.image_session import errors_after
from splatbus_conformance.trials.moves.listening import heard, listen
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import show, strings, within
from splatbus_conformance.wire.message_kinds import (
    CAPABILITIES,
    CLIENT_1_0,
    CLIENT_1_1,
    NEEDS,
    REPLIES,
    REQUESTS,
    SERVER_1_1,
    newer,
)
from splatbus_conformance.wire.messages import Json, camera_pose, encode, hello, intrinsics, reply
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import WORDS, Channel

ON_EITHER = {SERVER_IPC: ("1.1",), SERVER_MSG: ("1.1",)}
VERSIONS = ("1.1", "1.0")
MOST_VERSIONS: int = LIMITS["max_versions"]
MOST_CHARS: int = LIMITS["max_name_chars"]
DENIALS = {"unknown_type", "unsupported"}
"""What a server says of a message whose type, or whose capability, it does not have."""
ON_IPC, ON_MSG = CAPABILITIES["ipc"], CAPABILITIES["msg"]
UNSPOKEN = st.builds("{}.{}".format, st.integers(4000, 10**30), st.integers(0, 10**30))
"""Versions that nobody speaks yet."""
CLIENTS = tuple(
    {"name": text, "version": text} for text in ("", "v", "n" * MOST_CHARS, "🙂" * MOST_CHARS)
)


@check("NEG-4", on={CLIENT: ("hello:ipc",)})
def check_can_do_what_it_declares(trial: ClientTrial) -> None:
    """Uses each capability that the testee declares, as far as this machine can."""
    capabilities = trial.facts.capabilities()
    if "host_shm" not in capabilities:
        trial.not_observable("the testee does not declare host_shm; its memory is not of this host")
    connection = trial.greeted("ipc")
    dealings = trial.with_(connection)
    trial.expect(trial.opens(connection), "not-opened", "host_shm: the memory was not opened")
    if "frames" in capabilities:
        released = trial.wait(lambda: dealings.released)
        trial.expect(released, "not-released", "frames: no frame was released")
    if "reinit" in capabilities:
        former = dealings.generation
        trial.role.offer(connection)
        told = "reinit: the first generation was not closed for the second"
        trial.expect(trial.closes(connection, former), "not-closed", told)


@check("NEG-5", on={CLIENT: ("hello:ipc",)})
def check_sends_only_what_was_granted(trial: ClientTrial) -> bool:
    """First no welcome for a while, then one that grants host_shm alone, and a frame all the same
    of the memory that the testee has opened.
    """
    trial.role.welcomes = False
    connections = {channel: trial.connection(channel) for channel in sorted(trial.facts.connects)}
    for channel, connection in connections.items():
        if trial.facts.speaks_1_1(channel):
            trial.grows(connection, connection.messages)
    listen(trial, *connections.values())
    for channel, connection in connections.items():
        early = heard(trial, connection) - {"hello"}
        if channel == "msg":
            early = set().union(*map(newer, trial.with_(connection).heard))
        told = f"it sent {listing(early)} before welcome"
        trial.expect(not early, "before-welcome", told)
    connection = connections["ipc"]
    dealings = trial.with_(connection)
    trial.role.welcome(connection, capabilities=["host_shm"])
    answered = trial.wait(lambda: dealings.opened | dealings.failed)
    if dealings.opened:
        trial.lend(connection)
    listen(trial, connection)
    more = heard(trial, connection) - {"hello", "opened", "open_failed"}
    told = f"it sent {listing(more)}, which welcome did not grant"
    trial.expect(not more, "not-granted", told)
    return answered


@check(
    "NEG-5",
    on={CLIENT: ("hello:msg", "returns:msg")},
    cases=lambda trial: Cases(
        [[], *([it] for it in trial.facts.capabilities("msg") if it in ON_MSG)]
    ),
)
def check_sends_only_what_was_granted_on_the_message_channel(
    trial: ClientTrial, granted: list[str]
) -> bool:
    """A welcome that grants nothing, then one for each capability that the testee declares."""
    connection = unwelcome(trial, "msg")
    said = len(connection.messages)
    trial.role.welcome(connection, capabilities=granted)
    listen(trial, connection)
    for message in trial.with_(connection).heard:
        needed = NEEDS.get(str(message.get("type")))
        needed = "intrinsics" if "intrinsics" in newer(message) else needed
        what = f"it sent {message.get('type')}, which needs {needed}, after a welcome that"
        trial.expect(needed in (None, *granted), "not-granted", f"{what} lists {granted}")
    return len(connection.messages) > said


def spoken(trial: ServerTrial, channel: Channel) -> list[str]:
    """The versions that the server welcomes when nothing else is offered."""
    found = [version for version in VERSIONS if named(trial, channel, [version]) == version]
    return found or trial.not_observable("the server answers no hello")


def known_among_others(trial: ServerTrial, channel: Channel, speaks: list[str]) -> Cases:
    """Lists of up to 16 versions, of which the server speaks one or two, in any order."""
    strangers = st.lists(UNSPOKEN, max_size=MOST_VERSIONS - len(VERSIONS))
    known = st.lists(st.sampled_from(speaks), min_size=1, unique=True)
    lists = st.tuples(known, strangers).flatmap(lambda both: st.permutations(both[0] + both[1]))
    most = [f"4000.{number}" for number in range(MOST_VERSIONS - 1)]
    return Cases([[*most, speaks[0]]], lists, quick=12, full=500)


@check("NEG-6", on=ON_EITHER, given=spoken, cases=known_among_others)
def check_names_the_first_version_that_it_speaks(
    trial: ServerTrial, channel: Channel, speaks: list[str], versions: list[str]
) -> None:
    """Many versions, of clients whose names have no character, or as many as they may."""
    first = next(version for version in versions if version in speaks)
    client = CLIENTS[trial.number % len(CLIENTS)]
    found = named(trial, channel, versions, client=client)
    what = f"{channel}: of {', '.join(versions)[:80]} it speaks {first} first to {show(client)}"
    trial.expect(found is not None, "no-welcome", f"{what}, and it sent no welcome")
    trial.expect(found == first, "another-version", f"{what}, and welcome names {found}")


def unasked(trial: ServerTrial, channel: Channel) -> Cases:
    """What may come before hello, where it need not come first."""
    if channel == "ipc":
        return Cases([STRANGER])
    return Cases([] if trial.viewer.token else [STRANGER, VIEWPORT_REQUEST, camera_pose()])


@check("NEG-6", on=ON_EITHER, cases=unasked)
def check_answers_a_hello_that_comes_late(
    trial: ServerTrial, channel: Channel, message: Json
) -> None:
    """Something else comes before `hello`: what is answered, and what is ignored."""
    connection = trial.before_hello(channel)
    trial.viewer.say(connection, message)
    trial.viewer.greet(connection)
    what = f"{channel}: a hello behind a message of type {message['type']}"
    trial.expect(trial.is_welcomed(connection), "no-welcome", f"{what} had no welcome")
    connection.close()


def granted(trial: ServerTrial, channel: Channel, offer: Sequence[str]) -> set[str]:
    """The capabilities of `welcome` after a hello that lists these."""
    connection, answer = trial.answered(channel, capabilities=list(offer))
    what = f"{channel}: a hello that offers {shorten(listing(offer))}"
    trial.expect(within(answer, "type") == "welcome", "no-welcome", f"{what} got no welcome")
    connection.close()
    return set(trial.with_(connection).granted)


def offers(trial: ServerTrial, channel: Channel, has: set[str]) -> Cases:
    """Every set of the IPC channel's capabilities on that channel; on the message channel every
    few and nearly all of its own, and some of the other's.
    """
    own, most = CAPABILITIES[channel], len(CAPABILITIES[channel])
    counts = range(most + 1) if channel == "ipc" else (0, 1, 2, most - 1, most)
    found = [offer for count in counts for offer in combinations(own, count)]
    return Cases([*found, (*ON_IPC, *ON_MSG), ON_IPC])


@check(
    "NEG-7",
    on=ON_EITHER,
    given=lambda trial, channel: granted(trial, channel, CAPABILITIES[channel]),
    cases=offers,
)
def check_grants_what_both_have(
    trial: ServerTrial, channel: Channel, has: set[str], offer: Sequence[str]
) -> None:
    """Offers everything first; what is granted then is what the server has."""
    found = granted(trial, channel, offer)
    told = f"{channel}: it has {listing(has)}, was offered {listing(offer)}, and granted"
    trial.expect(found == has & {*offer}, "other-capabilities", f"{told} {listing(found)}")


@check("NEG-7", on={SERVER: ("1.1",)})
def check_has_what_it_grants(trial: ServerTrial) -> bool:
    """A valid message of each capability that `welcome` lists: none may be refused because its type
    were not known, or its capability not agreed upon. That images cannot have a size may be said.
    """
    client = trial.commanding()
    messages = _belonging(trial)
    names = [it for it in trial.with_(client).granted if it in messages]
    for name in trial.each(names):
        reported, answered = errors_after(trial, client, encode(messages[name]))
        told = f"it grants {name}, and after {show(messages[name])} came no reply"
        trial.expect(answered, "no-reply", told)
        codes = {str(it.get("code")) for it in reported}
        denied = codes & (DENIALS - {"unsupported"} if name == "viewport" else DENIALS)
        told = f"it grants {name}, and says {listing(denied)} of its message"
        trial.expect(not denied, "denied", told)
    if "subscribe" not in trial.facts.capabilities() or not trial.facts.opens:
        return bool(names)
    reader = trial.reading()
    script = packet(encode({"type": "subscribe", "channels": ["color", "depth"]}))
    outcome = trial.outcome_on_ipc(reader, script)
    denied = DENIALS & set(trial.with_(reader).errors())
    trial.expect(not denied, "denied", f"it grants subscribe, and says {listing(denied)} of that")
    told = f"it grants subscribe, and of that it {outcome}"
    trial.expect(outcome == "ignores", "not-ignored", told)
    return True


def _belonging(trial: ServerTrial) -> dict[str, Json]:
    """A valid message of each capability of the message channel, which changes little."""
    width, height = trial.facts.size
    sized = {"type": "set_viewport", "width": width, "height": height, "id": 1}
    lens = camera_pose() | {"intrinsics": intrinsics(width, height)}
    return {
        "objects": camera_pose(kind="object_pose") | {"object": DEFAULT},
        "scene": {"type": "get_scene", "id": 2},
        "time": {"type": "set_time", "time": 0},
        "ping": {"type": "ping", "t": 0.5, "id": 3},
        "telemetry": {"type": "subscribe_telemetry", "names": []},
    } | ({"intrinsics": lens, "viewport": sized} if width and height else {})


def listing(names: object) -> str:
    """Names in words."""
    return ", ".join(sorted(names)) or "nothing"  # type: ignore[call-overload]


def among_strangers(trial: Trial, channel: Channel) -> Cases:
    """The real capabilities among those of another time, up to 64 in all."""
    real = offered(trial, channel)
    most: int = LIMITS["max_capabilities"] - len(real)
    unknown = st.text(CHARACTERS, max_size=MOST_CHARS).filter(lambda it: it not in ON_IPC + ON_MSG)
    lists = st.lists(unknown, min_size=1, max_size=most, unique=True)
    listed = [["A-Z 0-9", ODD_TEXT, "", *real], [*(f"later-{n}" for n in range(most)), *real]]
    drawn = lists.flatmap(lambda strange: st.permutations([*strange, *real]))
    return Cases(listed, drawn, quick=3, full=12 if isinstance(trial, ClientTrial) else 250)


@check(
    "NEG-8",
    on={
        CLIENT_IPC: OPENS_HOST_MEMORY,
        CLIENT_MSG: ("hello:msg", "returns:msg"),
        SERVER_MSG: ("1.1",),
        SERVER_IPC: ("1.1",),  # last, for a camera is moved from a message connection that stays
    },
    cases=among_strangers,
)
def check_ignores_unknown_capabilities(
    trial: Trial, channel: Channel, capabilities: list[str]
) -> None:
    """`hello` or `welcome` lists capabilities of another time among the real ones."""
    strangers = {*capabilities} - {*offered(trial, channel)}
    what = f"what lists {shorten(listing(strangers))} on the {WORDS[channel]} channel"
    judge_agreement(trial, agreed(trial, channel, capabilities, what), what)


KNOWN = (*CLIENT_1_0, *CLIENT_1_1, *SERVER_1_1, *REPLIES)
NAMES = st.text(LETTERS, min_size=12, max_size=30) | st.text(CHARACTERS, max_size=100).filter(
    lambda name: name not in KNOWN
)
STRANGERS = st.builds(
    lambda kind, like, rest: {**like, **rest, "type": kind},
    NAMES,
    st.sampled_from([{}, *(reply({"type": kind}, typed=True) or {} for kind in REQUESTS)]),
    st.dictionaries(NAMES, st.none() | st.integers(0, 9) | NAMES, max_size=4),
)
NO_TYPES: tuple[Any, ...] = (
    *(None, 5, [], ["get_viewport_size"], {}, {"type": "ping"}),
    *("t" * 10_000, "🙂" * 2000),
)
ELSEWHERE: dict[Channel, tuple[Json, ...]] = {
    "ipc": (
        {"type": "get_viewport_size"},
        {"type": "get_camera_pose", "cam_idx": 0},
        {"type": "ping", "t": 0},
        camera_pose(),
    ),
    "msg": (
        *({"type": kind, "generation": 1} for kind in ("opened", "closed")),
        {"type": "open_failed", "generation": 1, "reason": "none"},
        {"type": "release", "generation": 1, "seq": 0},
    ),
}
"""Of the other channel: on this one their type is not known."""


def of_strange_types(trial: Trial, channel: Channel) -> Cases:
    """Messages of types that nobody knows, some with the members of replies."""
    if isinstance(trial, ClientTrial):
        return Cases(drawn=STRANGERS, quick=10, full=100)
    listed = [*({"type": kind} for kind in NO_TYPES), *ELSEWHERE[channel]]
    return Cases(listed, STRANGERS, quick=15, full=750)


@check(
    "NEG-9",
    on={
        CLIENT_IPC: OPENS_HOST_MEMORY,
        CLIENT_MSG: ("hello:msg", "poses"),
        SERVER_IPC: ("1.1",),
        SERVER_MSG: ("1.1",),
    },
    cases=of_strange_types,
)
def check_ignores_unknown_types(trial: Trial, channel: Channel, message: Json) -> None:
    """They come after `hello` and `welcome`, and to a client between init packets, too."""
    outcome = trial.outcome(agreeing(trial, channel), packet(encode(message)))
    kind = shorten(repr(message["type"]))
    trial.judge(outcome, f"a message of type {kind} on the {WORDS[channel]} channel")


@check("NEG-9", on={CLIENT: ("hello:msg", "poses")})
def check_takes_no_unknown_type_for_a_reply(trial: ClientTrial) -> None:
    """A message of a type that nobody knows has the `id` of a request, and comes before its reply;
    the reply follows, since nobody has to wait for one for long (CHN-15).
    """
    connection = asking(trial)
    for request in requests(trial, connection):
        trial.role.say(connection, STRANGER | {"id": request.get("id", 0)})
        trial.role.reply(connection, request)
    trial.judge(trial.outcome_on_msg(connection), "an unknown type with the id of a request")


@check(
    "NEG-16",
    on={CLIENT_IPC: ("hello:ipc",), CLIENT_MSG: ("hello:msg",)},
    cases=Cases(("9.9", "2.0", "1.10")),
)
def check_refuses_a_version_it_did_not_list(
    trial: ClientTrial, channel: Channel, version: str
) -> None:
    """`welcome` names a version that the testee's hello did not list."""
    role = trial.role
    # A reply before welcome would make the testee take its server to speak 1.0 (NEG-13).
    trial.peer.close_all()
    role.welcomes = role.offers_memory = role.replies = False
    connection = trial.connection(channel)
    if not trial.says_hello(connection):
        trial.not_observable(f"the testee said no hello on the {channel} channel")
    role.welcome(connection, version=version)
    outcome = "closes" if trial.ends(connection) else "accepts"
    role.welcomes = role.offers_memory = role.replies = True
    trial.judge(outcome, f"welcome with version {version!r} on the {channel} channel")
    trial.expect(trial.comes_back(channel), "no-reconnect", "it did not come back afterwards")


@check(
    "NEG-10",
    on=ON_EITHER,
    given=spoken,
    cases=Cases(drawn=st.lists(UNSPOKEN, min_size=1, max_size=MOST_VERSIONS), quick=5, full=250),
)
def check_refuses_unknown_versions(
    trial: ServerTrial, channel: Channel, speaks: list[str], versions: list[str]
) -> None:
    """Lists of versions that nobody speaks yet; the error lists what the server speaks."""
    what = f"{channel}: a hello that lists {', '.join(versions)[:60]}"
    connection = refused(trial, channel, "unsupported_version", what, versions=versions)
    listed = strings(within(trial.with_(connection).answer, "supported")) or []
    trial.expect(listed, "no-versions", f"{what} was not told what is supported")
    unlisted = {*speaks} - {*listed}
    told = f"{what} was not told of {listing(unlisted)}, which it speaks"
    trial.expect(not unlisted, "version-left-out", told)


BAD_MEMBERS: dict[str, tuple[Any, ...]] = {
    "versions": (
        *(None, [], "1.1", [1.1], ["1.1"] * 17, ["1.01"], ["01.1"], ["1.1", "v" * 65]),
        *(["1.1\n"], ["1.1 "], ["١.١"]),
    ),
    "client": (None, "me", {"name": "me"}, {"name": 1, "version": "1"}),
    "capabilities": (None, {}, [1], ["a", "a"], ["c" * 65], "frames"),
}
"""Members that are wrong; None leaves one out."""


@check(
    "NEG-35",
    on=ON_EITHER,
    cases=Cases([{name: value} for name, values in BAD_MEMBERS.items() for value in values]),
)
def check_refuses_broken_hellos(trial: ServerTrial, channel: Channel, changes: Json) -> None:
    """Objects of type `hello` that miss or mistype members."""
    what = f"{channel}: a hello with {show(changes)}"
    refused(trial, channel, "invalid_message", what, **changes)


@check("NEG-33", on=ON_EITHER)
def check_speaks_1_0_to_who_asked_for_it(trial: ServerTrial, channel: Channel) -> None:
    """A client that offers everything, and speaks 1.0 alone: what follows is as without `hello`,
    and another `hello` is none of 1.0.
    """
    everything = list(CAPABILITIES[channel])
    connection, answer = trial.answered(channel, versions=["1.0"], capabilities=everything)
    if within(answer, "code") == "unsupported_version":
        trial.not_observable("the server does not speak 1.0")
    what = f"{channel}: a hello that lists 1.0 was answered by {show(answer)}"
    trial.expect(within(answer, "type") == "welcome", "no-welcome", what)
    trial.expect(within(answer, "capabilities") == [], "other-capabilities", what)
    heard = trial.with_(connection).heard
    trial.viewer.say(connection, hello(everything, trial.viewer.token))
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
        # Other members may be there, which nobody knows (JSN-7).
        replies, of_1_1 = {"viewport_size", "position"}, {"type", "id"}
        odd = [it for it in heard[1:] if not replies & set(it) or of_1_1 & set(it)]
    else:
        trial.rest(REACTION_SECONDS)
        if not trial.facts.alone[channel]:
            joined(trial)  # the pace
        odd = [it for it in heard if it != answer and "mem_color" not in it]
    told = f"{channel}: a client that speaks 1.0 was sent {show(odd[:1])}"
    trial.expect(not odd, "newer-version", told)
    connection.close()


@check("NEG-11", on={SERVER: ("1.1",)})
def check_waits_for_who_can_open_its_memory(trial: ServerTrial) -> bool:
    """Connections without `hello`, and with one that does not list `host_shm`: no init packet
    comes.
    """
    if within(trial.facts.init_packet, "memory", "kind") != "host_shm":
        trial.not_observable("the server announces no memory of the host")
    others = [name for name in ON_IPC if name not in ("host_shm", "cuda_ipc")]
    waiting = {
        "before hello": trial.before_hello("ipc"),
        "after a hello that lists nothing": trial.greeted("ipc", capabilities=[]),
        f"after a hello that lists {listing(others)}": trial.greeted("ipc", capabilities=others),
    }
    trial.rest(REACTION_SECONDS)
    told = trial.with_(trial.ready("ipc")).init_packets  # it has had the time for it
    for moment, connection in waiting.items():
        packets = trial.with_(connection).init_packets
        trial.expect(not packets, "unwanted-init-packet", f"an init packet {moment}")
    trial.judge("waits", "connections that cannot open memory of the host")
    return bool(told)


@check("NEG-15", on={SERVER: ("1.1",)})
def check_sends_cuda_memory_at_once(trial: ServerTrial) -> None:
    """A connection on which nothing is said, to a server that announces CUDA memory."""
    greeted = trial.with_(trial.greeted("ipc", capabilities=list(ON_IPC)))
    trial.wait(lambda: greeted.init_packets)
    announced = [*greeted.init_packets, trial.facts.init_packet][0]
    if not (trial.facts.at_once or within(announced, "memory", "kind") == "cuda_ipc"):
        trial.not_observable("the server announces no CUDA memory")
    silent = trial.with_(trial.before_hello("ipc"))
    trial.wait(lambda: silent.heard)
    trial.expect(silent.init_packets, "no-init-packet", "no init packet came before hello")
    trial.expect("version" in silent.heard[0], "no-version", "its init packet names no version")
