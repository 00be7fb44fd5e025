"""Allowed variations: servers that are unusual, and conform. The harness must pass them."""

from splatbus_conformance.wire.messages import init_packet_1_0
from splatbus_server.connection import REQUESTS, Refusal, type_and_id
from splatbus_wire.messages import GetViewportSize, Placement, ViewportSize
from splatbus_wire.poses import IDENTITY, Pose

from tests.zoo.faults.legacy import announces_at_once
from tests.zoo.faults.newest import keeps_the_newest
from tests.zoo.faults.respelling import (
    add_members,
    escape_letters,
    reverse_members,
    space_out,
    write_fractions,
)
from tests.zoo.faults.seams import renderer, server, wire
from tests.zoo.mutant import variation

CAMERAS = tuple(Pose((float(n), 0.5, -4.0), (0.0, 0.6, 0.0, 0.8)) for n in range(3))


@variation()
def server_members_that_nobody_knows(patch):
    """Adds members of its own to every message."""
    add_members(patch)


@variation()
def server_members_in_reverse_order(patch):
    """Writes the members of every object in reverse."""
    reverse_members(patch)


@variation()
def server_white_space_everywhere(patch):
    """Writes JSON for people, with white space around it."""
    space_out(patch)


@variation()
def server_escapes_everywhere(patch):
    """Writes every letter in names and strings as an escape."""
    escape_letters(patch)


@variation()
def server_numbers_with_exponents(patch):
    """Writes every fraction with 17 digits and an exponent."""
    write_fractions(patch, b"%.17E")


@variation(warns=("FRM-7",), at=server.FLUSHES)
def server_sends_byte_by_byte(original, self, peer, now):
    """Hands TCP one byte at a time."""
    unsent = peer.connection.unsent
    try:
        while len(unsent) > 1:
            del unsent[: peer.socket.send(unsent[:1])]
    except OSError:
        pass
    original(self, peer, now)


@variation(at=server.REFUSES_PACKET)
def server_closes_on_what_is_broken(original, self, error, now):
    """Closes a message connection of 1.0 on broken text and broken poses."""
    is_1_0 = self.welcome is None and type_and_id(error.received)[0] != "hello"
    if is_1_0 and self.channel == "msg" and error.code != "unknown_type":
        self.end("it is broken", now)
    return original(self, error, now)


@variation(at=server.REFUSES_PACKET)
def server_ignores_broken_requests(original, self, error, now):
    """Leaves a message connection of 1.0 open after a broken request."""
    if self.welcome is None and type_and_id(error.received)[0] in REQUESTS:
        return Refusal(error.code, str(error))
    return original(self, error, now)


@variation()
def server_takes_no_strings_for_numbers(patch):
    """Refuses poses whose numbers are strings."""
    wire.POSE_OF_1_0.wrap(patch, lambda original, message, or_strings=False: original(message))


@variation()
def server_keeps_the_newest_client(patch):
    """Serves one client on each channel, and closes it when the next comes."""
    keeps_the_newest(patch, 1)


@variation(warns=("CHN-25",))
def server_keeps_two_connections(patch):
    """Serves two clients on each channel, and closes the older when a third comes."""
    keeps_the_newest(patch, 2)


@variation()
def server_keeps_the_oldest_client(patch):
    """Serves one client on each channel, and closes others at once."""
    server.MOST_CONNECTIONS.replace(patch, 1)


@variation()
def server_keeps_many_clients(patch):
    """Serves sixty-four clients on each channel."""
    server.MOST_CONNECTIONS.replace(patch, 64)


@variation()
def server_without_reinit(patch):
    """Has neither `reinit` nor `subscribe`."""
    server.CAPABILITIES_ON_IPC.replace(patch, ("host_shm", "frames"))


@variation()
def server_without_frames(patch):
    """Has no `frames`: announces memory, and lends nothing."""
    server.CAPABILITIES_ON_IPC.replace(patch, ("host_shm",))


@variation()
def server_speaks_1_0(patch):
    """Speaks 1.0 alone: a hello is an unknown type. Its images are in memory of the host."""
    _knows_no_hello(patch)


@variation()
def server_speaks_1_0_of_cuda_memory(patch):
    """Speaks 1.0 alone, and announces CUDA memory to everybody at once."""
    _knows_no_hello(patch)
    announces_at_once(patch, init_packet_1_0())


@variation()
def server_comes_with_cameras(patch):
    """Shows a scene with three cameras."""
    _serves(patch, cameras=CAMERAS)


@variation()
def server_comes_with_one_camera(patch):
    """Shows a scene with one camera."""
    _serves(patch, cameras=CAMERAS[2:])


@variation(at=server.HANDLES_MESSAGE)
def server_tells_no_size_at_first(original, self, connection, message, *rest):
    """Tells the size `[0,0]` until it has rendered an image."""
    nothing_yet = self.exchange.memory.ring.last_seq == 0
    if isinstance(message, GetViewportSize) and nothing_yet:
        connection.send(ViewportSize(0, 0, message.id))
        return None
    return original(self, connection, message, *rest)


@variation()
def server_turns_its_scene(patch):
    """Turns the scene by itself, a little from each image to the next."""
    _renders(patch, 60.0, 0.3)


@variation()
def server_renders_slowly(patch):
    """Renders thirty images a second at most."""
    _renders(patch, 30.0, 0.0)


@variation(at=server.PASSES_CONTROL_ON)
def server_goes_home(original, self, connection):
    """Puts camera and Gaussians back when the client that moved them has gone."""
    had_control = next(iter(self.sent), None) is connection
    if had_control:
        at_rest = {name: Placement(name, IDENTITY) for name in self.poses.objects}
        self.poses = self.poses._replace(camera=IDENTITY, objects=at_rest, tag=None)
    return bool(original(self, connection)) or had_control


@variation()
def server_lends_to_one_reader(patch):
    """Has slots for one client that reads images."""
    _serves(patch, readers=1)


@variation(at=server.LAYS_OUT_RING)
def server_spaces_its_ring(original, width, height, slots):
    """Puts depth before colour, with gaps between the slots and before them."""
    layout, _ = original(width, height, slots)
    depth = layout.depth_stride + 48
    color = layout.color_stride + 80
    begin = 4096 + slots * depth
    moved = layout._replace(
        depth_offset=4096, depth_stride=depth, color_offset=begin, color_stride=color
    )
    return moved, begin + slots * color + 20


def _knows_no_hello(patch):
    def understand(original, self, payload, now):
        if b"hello" in payload and self.channel == "msg":
            payload = payload.replace(b"hello", b"aloha")
        if self.channel == "ipc":
            return Refusal("unknown_type", "this channel speaks, and does not listen")
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)


def _serves(patch, **changed):
    renderer.SERVES.wrap(patch, lambda original, *a, **named: original(*a, **named | changed))


def _renders(patch, fps, degrees_per_second):
    def render(original, stop, bus, *_):
        original(stop, bus, fps, degrees_per_second)

    renderer.RENDERS_UNTIL_TOLD.wrap(patch, render)
