"""Mutants that break what 1.1 adds on the message channel: CAM, OBJ, SCN, VPT, TIM, PNG, TEL."""

from splatbus_client import message_protocol
from splatbus_client.events import Refused
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_client.outgoing import Told
from splatbus_client.steering import Steering
from splatbus_wire import from_server
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    CameraPose,
    GetScene,
    Intrinsics,
    ObjectPose,
    Ping,
    Pose,
    Request,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
)

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import crash, messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.neg.clients import without

POSE = Pose((1.0, -2.0, 5.0), (0.0, 0.6, 0.0, 0.8))
LENS = Intrinsics(64.0, 64.0, 32.0, 24.0, 64, 48, 0.01, 100.0)
TOLD: tuple[Told, ...] = (
    CameraPose(POSE, None, "mutant-1", LENS),
    ObjectPose("chair", POSE, 0.5),
    SetTime(1.25),
    SubscribeTelemetry(None),
)
ASKED: tuple[Request, ...] = (GetScene(), SetViewport(32, 24), Ping(0.0))


def says(patch, told=TOLD, asked=ASKED):
    """Say all this on each connection of the message channel, as far as it is agreed upon."""

    def begin(original, self):
        machine: MessageProtocol = original(self)
        for message in told:
            machine.tell(message)
        for request in asked:
            machine.ask(request)
        return machine

    client.BEGINS_TO_STEER.wrap(patch, begin)


def _broken(patch, kind, **members):
    """Say everything, and one type of message with these members changed."""
    says(patch)
    messages(patch, of_type(kind, lambda message: message | members))


def _without(patch, kind, member):
    says(patch)
    messages(patch, of_type(kind, without(member)))


@mutant("CAM-1", code="bad-string")
def empty_tags(patch):
    """Gives its pose an empty tag."""
    says(patch)
    messages(patch, lambda message: message | {"tag": ""} if "tag" in message else message)


@mutant("CAM-4", code="out-of-range")
def a_lens_of_no_length(patch):
    """Sends intrinsics with a focal length of 0."""
    says(patch)

    def flatten(message):
        return message | {"intrinsics": message["intrinsics"] | {"fx": 0.0}}

    messages(patch, lambda message: flatten(message) if "intrinsics" in message else message)


@mutant("OBJ-1", code="out-of-range")
def objects_of_no_size(patch):
    """Shrinks an object to nothing."""
    _broken(patch, "object_pose", scale=0.0)


@mutant("OBJ-1", code="missing-member")
def poses_of_no_object(patch):
    """Does not say which object it moves."""
    _without(patch, "object_pose", "object")


@mutant("SCN-1", code="wrong-value")
def asks_for_scenes_in_camel_case(patch):
    """Writes the type of its request for the scene otherwise."""
    _broken(patch, "get_scene", type="getScene")


@mutant("VPT-1", code="not-an-integer")
def half_a_pixel(patch):
    """Asks for images of 32½ columns."""
    _broken(patch, "set_viewport", width=32.5)


@mutant("VPT-9", check="check_asks_for_a_size_again_later", code="too-soon")
def asks_for_a_size_until_it_has_it(patch):
    """Asks for images of another size again as soon as it is told `busy`."""
    asks_for_a_size_again(patch)
    client.PAUSE_TO_ASK_AGAIN.replace(patch, 0.0)


def asks_for_a_size_again(patch):
    """Ask for images of another size, and again when that is answered `busy`."""

    def handle(original, self, event):
        original(self, event)
        if isinstance(event, Refused) and event.error.code == "busy" and self.machine is not None:
            self.machine.ask(SetViewport(32, 24))

    says(patch, (), (SetViewport(32, 24),))
    Seam(Steering, "handle").wrap(patch, handle)


@mutant("TIM-1", code="not-a-number")
def no_time_in_particular(patch):
    """Sets the time to null."""
    _broken(patch, "set_time", time=None)


@mutant("PNG-1", code="missing-member")
def pings_without_a_time(patch):
    """Does not say when it sends a ping."""
    _without(patch, "ping", "t")


@mutant("TEL-1", code="not-an-array")
def subscribes_to_all_by_name(patch):
    """Subscribes to all series with a word instead of null."""
    _broken(patch, "subscribe_telemetry", names="all")


@mutant("TEL-6", check="check_ignores_series_of_unknown_kinds", code="dies")
def crashes_on_unknown_series(patch):
    """Dies of a series whose kind it does not know."""
    says(patch)

    def series(original, item):
        found = original(item)
        return crash() if found is None else found

    Seam(from_server, "one_series").wrap(patch, series)


@mutant(
    "JSN-10",
    check="check_survives_bad_replies_of_1_1",
    code="dies",
)
def crashes_on_a_broken_scene(patch):
    """Dies of a scene that breaks a rule."""
    says(patch)

    def scene(original, message):
        try:
            return original(message)
        except ProtocolError:
            crash()

    Seam(from_server, "scene").wrap(patch, scene)


@mutant(
    "NEG-5",
    check="check_sends_only_what_was_granted_on_the_message_channel",
    code="not-granted",
)
def sends_what_was_not_granted(patch):
    """Says all that it can, whatever `welcome` lists."""
    says(patch)
    client.CUTS_TO_WHAT_WAS_AGREED.replace(patch, lambda message, *agreed: message)


@mutant("NEG-5", code="not-granted", through="NEG-5")
def pings_without_the_capability(patch):
    """Sends `ping` whether `welcome` lists it or not."""
    says(patch, (), (Ping(0.0),))
    Seam(MessageProtocol, "lacks").replace(patch, lambda self, message: None)


@mutant("NEG-5", check="check_sends_only_what_was_granted", code="before-welcome")
def tags_before_welcome(patch):
    """Gives poses their tags before it knows what its server speaks."""
    says(patch, [CameraPose(POSE, None, "mutant-1")], ())
    Seam(message_protocol, "only_1_1").replace(patch, lambda message: False)
    client.CUTS_TO_WHAT_WAS_AGREED.replace(patch, lambda message, *agreed: message)


@mutant("NEG-13", code="no-fallback", through="NEG-13", at=client.CUTS_TO_WHAT_WAS_AGREED)
def tags_to_a_1_0_server(original, message, *agreed):
    """Gives poses their tags whatever its server speaks."""
    sent = original(message, *agreed)
    return sent._replace(tag="mutant-1") if isinstance(sent, CameraPose) else sent


@mutant(
    "NEG-24",
    check="check_survives_errors_in_place_of_replies",
    code="dies",
    at=client.TAKES_ERROR,
)
def crashes_when_another_has_control(original, self, error):
    """Dies when it is told that another client has control."""
    return crash() if error.code == "busy" else original(self, error)


@mutant(
    "IMG-12",
    check="check_releases_before_it_closes",
    code="closed-before-release",
)
def closes_before_it_releases(patch):
    """Sends what it gives back behind all else."""
    _releases_last(patch)


@mutant("IMG-12", code="not-released", through="IMG-12")
def releases_what_it_has_closed(patch):
    """Gives images back last of all, also those of memory that it has closed."""
    _releases_last(patch)


def _releases_last(patch):
    late: dict[IpcProtocol, bytes] = {}

    def give_back(original, self, generation, seq):
        before = len(self.unsent)
        original(self, generation, seq)
        late[self] = late.get(self, b"") + bytes(self.unsent[before:])
        del self.unsent[before:]

    def data_to_send(original, self, now):
        sent: bytes = original(self, now)
        return sent + late.pop(self, b"")

    Seam(IpcProtocol, "give_back").wrap(patch, give_back)
    Seam(IpcProtocol, "data_to_send").wrap(patch, data_to_send)
