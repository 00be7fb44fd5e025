"""Mutants that break JSN: what is sent is no strict JSON, or what is read is not read so."""

import re

from splatbus_conformance.wire.packets import packet
from splatbus_wire.messages import Scene

from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import in_poses, payloads
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.chn.clients import speaks_1_0
from tests.zoo.mutants.v1_0.jsn.servers import trusts_its_scene
from tests.zoo.mutants.v1_1.neg.granted import says

DEPTH = 70
NUMBER = re.compile(rb"(?<=:)-?[0-9][0-9.e-]*")
ID = re.compile(rb'(?<="id":)[0-9]+')


@mutant("JSN-1", code="no-object")
def poses_in_an_array(patch):
    """Sends each pose as an array of one object."""
    payloads(patch, in_poses(lambda payload: b"[" + payload + b"]"))


@mutant("JSN-1", code="not-utf-8")
def text_in_latin_1(patch):
    """Encodes text as Latin-1."""
    payloads(patch, in_poses(lambda payload: payload[:-1] + ',"note":"für"}'.encode("latin-1")))


@mutant("JSN-1", code="no-json")
def single_quotes(patch):
    """Quotes with apostrophes."""
    payloads(patch, in_poses(lambda payload: payload.replace(b'"', b"'")))


@mutant("JSN-1", code="no-json")
def trailing_comma(patch):
    """Writes a comma after the last member."""
    payloads(patch, in_poses(lambda payload: payload[:-1] + b",}"))


@mutant("JSN-1", code="no-json")
def two_objects_in_a_payload(patch):
    """Puts two poses into one payload."""
    payloads(patch, in_poses(lambda payload: payload + payload))


@mutant("JSN-1", code="no-json")
def zero_byte_after_the_text(patch):
    """Sends the terminating zero of a C string."""
    payloads(patch, in_poses(lambda payload: payload + b"\0"))


@mutant("JSN-2", code="byte-order-mark")
def byte_order_mark(patch):
    """Begins poses with a byte-order mark."""
    payloads(patch, in_poses(lambda payload: b"\xef\xbb\xbf" + payload))


@mutant("JSN-3", code="member-twice")
def type_twice(patch):
    """Writes `type` twice, the same both times."""
    payloads(patch, in_poses(lambda payload: payload[:-1] + b',"type":"camera_pose"}'))


@mutant("JSN-3", code="member-twice")
def coordinate_twice(patch):
    """Writes one coordinate twice in `position`."""
    payloads(patch, in_poses(lambda payload: payload.replace(b'{"x":', b'{"x":0,"x":', 1)))


@mutant("JSN-4", code="not-finite")
def not_a_number(patch):
    """Sends NaN."""
    payloads(patch, in_poses(lambda payload: payload[:-1] + b',"exposure":NaN}'))


@mutant("JSN-4", code="not-finite")
def a_share_of_no_time(patch):
    """Says what share of the time of a scene has gone by, also of one that has no length."""
    says(patch)

    def replied(original, self, reply, now):
        yield from original(self, reply, now)
        if isinstance(reply, Scene) and reply.time_range and len({*reply.time_range}) == 1:
            self.unsent += packet(b'{"type":"set_time","time":NaN}')

    client.TAKES_REPLY.wrap(patch, replied)


@mutant("JSN-4", code="not-finite")
def minus_infinity(patch):
    """Sends -Infinity."""
    payloads(patch, in_poses(lambda payload: payload[:-1] + b',"exposure":-Infinity}'))


@mutant("JSN-4", code="overflows")
def number_that_overflows(patch):
    """Sends a number beyond double precision."""
    payloads(patch, in_poses(lambda payload: payload[:-1] + b',"exposure":1e400}'))


@mutant("JSN-4", code="overflows")
def id_that_overflows(patch):
    """Numbers its requests beyond double precision."""
    payloads(patch, lambda payload: ID.sub(b"1e400", payload))


@mutant("JSN-5", code="too-deep")
def deep_nesting(patch):
    """Nests arrays too deep, in a member that nobody knows."""
    nested = b"[" * (DEPTH - 1) + b"]" * (DEPTH - 1)
    payloads(patch, in_poses(lambda payload: payload[:-1] + b',"tree":' + nested + b"}"))


@mutant("JSN-4", check="check_writes_numbers_once_it_has_images", code="number-as-string")
def numbers_as_strings_in_1_0(patch):
    """Speaks 1.0, and writes the numbers of a pose as strings."""
    speaks_1_0(patch)
    numbers_as_strings(patch)


@mutant("JSN-4", code="number-as-string")
def numbers_as_strings(patch):
    """Writes the numbers of a pose as strings."""
    payloads(patch, in_poses(lambda payload: NUMBER.sub(rb'"\g<0>"', payload)))


@mutant("JSN-12", code="too-many-values", both=True)
def zeros_without_number(patch):
    """Appends seventy thousand zeros to all that is said of the size."""
    trusts_its_scene(patch)
    zeros = b',"zeros":[' + b"0," * 70_000 + b"0]}"
    payloads(patch, lambda it: it[:-1] + zeros if b'viewport_size"' in it else it)
