"""Checks on `hello`, `welcome` and `error` (spec 1.1 chapter 2)."""

from hypothesis import strategies as st

from splatbus_conformance.checks import OPENS_HOST_MEMORY, check
from splatbus_conformance.client_trial import ClientTrial
from splatbus_conformance.messages import encode
from splatbus_conformance.packets import packet
from splatbus_conformance.peer import CHANNELS, Connection

LEGACY = {"camera_pose", "point_cloud_pose", "get_viewport_size", "get_camera_pose"}
LISTENING_SECONDS = 0.4
CODES = (
    "malformed_packet packet_too_large unsupported_version unauthorized too_many_clients "
    "malformed_json not_an_object unknown_type invalid_message invalid_rotation invalid_number "
    "unsupported busy internal a_code_of_tomorrow"
).split()


def heard(trial: ClientTrial, connection: Connection) -> set[str]:
    """The types of all that the testee said on a connection."""
    return {str(message.get("type")) for message in trial.role.with_(connection).heard}


@check(
    "NEG-4",
    observable="memory is opened, a frame released, old memory closed, as declared",
    needs=("hello:ipc",),
)
def check_can_do_what_it_declares(trial: ClientTrial) -> None:
    """Uses each capability that the testee declares, as far as this machine can."""
    declared = set(trial.facts.capabilities())
    if "host_shm" not in declared:
        trial.not_observable("the testee does not declare host_shm; its memory is not of this host")
    connection = trial.greeted("ipc")
    dealings = trial.role.with_(connection)
    trial.expect(trial.wait(lambda: 1 in dealings.opened), "host_shm: the memory was not opened")
    if "frames" in declared:
        trial.expect(trial.wait(lambda: dealings.released), "frames: no frame was released")
    if "reinit" in declared:
        trial.role.offer(connection, trial.role.init_packet(connection))
        closed = trial.wait(lambda: 1 in dealings.closed)
        trial.expect(closed, "reinit: the first generation was not closed for the second")
    trial.delivered += 1


@check(
    "NEG-5",
    observable="what the testee sends before welcome, and after one that grants little",
    needs=("hello:ipc",),
)
def check_sends_only_what_was_granted(trial: ClientTrial) -> None:
    """First no welcome for a while, then one that grants host_shm alone."""
    trial.role.welcomes = False
    connections = [trial.connection(channel) for channel in sorted(trial.facts.connects)]
    trial.rest(LISTENING_SECONDS)
    for connection in connections:
        allowed = {"hello"} | (LEGACY if connection.channel == "msg" else set())
        early = heard(trial, connection) - allowed
        trial.expect(not early, f"it sent {', '.join(sorted(early))} before welcome")
    connection = next(c for c in connections if c.channel == "ipc")
    dealings = trial.role.with_(connection)
    trial.role.welcome(connection, capabilities=["host_shm"])
    trial.wait(lambda: dealings.opened)
    trial.rest(LISTENING_SECONDS)
    more = heard(trial, connection) - {"hello", "opened", "open_failed"}
    trial.expect(not more, f"it sent {', '.join(sorted(more))}, which welcome did not grant")
    trial.delivered += 1


@check(
    "NEG-8",
    observable="the testee opens memory after a welcome with capabilities that nobody knows",
    needs=OPENS_HOST_MEMORY,
)
def check_ignores_unknown_capabilities(trial: ClientTrial) -> None:
    """`welcome` lists capabilities of another time beside the real ones."""
    trial.role.welcomes = False
    word = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=1, max_size=64)
    names = st.lists(word, max_size=5, unique=True)
    for unknown in trial.each(drawn=names, quick=3, full=12):
        connection = trial.connection("ipc")
        trial.says_hello(connection)
        real = [name for name in trial.facts.capabilities() if name != "subscribe"]
        trial.role.welcome(connection, capabilities=[*unknown, *real])
        trial.expect(
            trial.opens(connection),
            f"after a welcome that lists {unknown} the memory was not opened",
        )
        trial.delivered += 1


@check(
    "NEG-9",
    observable="the testee goes on after messages of unknown types",
    needs=OPENS_HOST_MEMORY,
)
def check_ignores_unknown_types(trial: ClientTrial) -> None:
    """Messages of types that nobody knows, before and between init packets, and unasked."""
    names = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=12, max_size=30)
    values = st.dictionaries(names, st.none() | st.integers(0, 9) | names, max_size=4)
    messages = st.builds(lambda kind, rest: {**rest, "type": kind}, names, values)
    trial.role.offers_memory = False
    connection = trial.greeted("ipc")
    for message in trial.each(drawn=messages, quick=10, full=100):
        if connection.ended or "reinit" not in trial.facts.capabilities():
            connection = trial.greeted("ipc")
        outcome = trial.outcome_on_ipc(connection, packet(encode(message)))
        trial.judge(outcome, f"a message of type {message['type']!r} on the IPC channel")
    if trial.facts.speaks_1_1("msg") and trial.facts.poses:
        connection = trial.greeted("msg")
        connection.send(packet(encode({"type": "weather_report", "sunny": True})))
        before = len(connection.packets)
        trial.wait(lambda: len(connection.packets) > before or connection.ended)
        outcome = "closes" if connection.ended else "ignores"
        trial.judge(outcome, "a message of type 'weather_report' on the message channel")
        trial.delivered += 1


@check(
    "NEG-13",
    observable="what the testee sends on the message channel of a 1.0 server",
    needs=("hello:msg",),
)
def check_falls_back_on_the_message_channel(trial: ClientTrial) -> None:
    """A server that knows no hello answers get_viewport_size; the testee is listened to."""
    trial.role.speaks = "1.0"
    connection = trial.connection("msg")
    dealings = trial.role.with_(connection)
    if not trial.wait(lambda: dealings.count("get_viewport_size")):
        trial.not_observable("the testee does not ask for the size after hello")
    trial.rest(LISTENING_SECONDS)
    trial.expect(not connection.ended, "it closed the connection to a 1.0 server")
    more = heard(trial, connection) - LEGACY - {"hello"}
    trial.expect(not more, f"it sent {', '.join(sorted(more))} to a 1.0 server")
    trial.delivered += 1


@check(
    "NEG-14",
    observable="what the testee sends on the IPC channel of a 1.0 server",
    needs=("hello:ipc",),
)
def check_falls_back_on_the_ipc_channel(trial: ClientTrial) -> None:
    """A server that knows no hello sends its init packet at once; the testee is listened to."""
    trial.role.speaks = "1.0"
    connection = trial.connection("ipc")
    trial.rest(LISTENING_SECONDS)
    more = heard(trial, connection) - {"hello"}
    trial.expect(not more, f"it sent {', '.join(sorted(more))} to a 1.0 server")
    if connection.ended:
        trial.not_observable("the testee closed the connection to a 1.0 server")
    trial.delivered += 1


@check(
    "NEG-16",
    observable="the testee closes the connection",
    needs=("hello:ipc", "returns:ipc"),
)
def check_refuses_a_version_it_did_not_list(trial: ClientTrial) -> None:
    """`welcome` names a version that the testee's hello did not list."""
    for channel in CHANNELS:
        for version in ("9.9", "2.0", "1.10"):
            if not trial.facts.speaks_1_1(channel):
                continue
            # A reply before welcome would make the testee take its server to speak 1.0 (NEG-13).
            trial.peer.close_all()
            trial.role.welcomes = trial.role.offers_memory = trial.role.replies = False
            connection = trial.connection(channel)
            trial.says_hello(connection)
            trial.role.welcome(connection, version=version)
            outcome = "closes" if trial.ends(connection) else "accepts"
            trial.role.welcomes = trial.role.offers_memory = trial.role.replies = True
            trial.judge(outcome, f"welcome with version {version!r} on the {channel} channel")
            trial.expect(trial.comes_back(channel), "it did not come back afterwards")


@check(
    "NEG-24",
    observable="the process lives, and the testee goes on or comes back after a pause",
    needs=(*OPENS_HOST_MEMORY, "returns:ipc"),
    may_crash=True,
)
def check_survives_errors(trial: ClientTrial) -> None:
    """An error of each code, and of one that nobody knows, on both channels."""
    for code in trial.each(CODES):
        error = packet(encode({"type": "error", "code": code, "message": "a test", "pointer": "/"}))
        trial.role.offers_memory = False
        connection = trial.greeted("ipc")
        outcome = trial.outcome_on_ipc(connection, error)
        trial.judge(outcome, f"an error {code} on the IPC channel")
    if trial.facts.asks and trial.facts.speaks_1_1("msg"):
        trial.role.offers_memory = True
        error = packet(encode({"type": "error", "code": "internal", "message": "a test"}))
        trial.judge(trial.outcome_of_reply(error), "an error in place of a reply")
