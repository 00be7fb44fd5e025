"""What client and server share: bytes, JSON, and the messages in it."""

from splatbus_wire import (
    decoding,
    encoding,
    framing,
    from_client,
    init_packet,
    json_text,
    negotiation,
)
from splatbus_wire.conventions import Engine
from splatbus_wire.framing import PacketDecoder
from splatbus_wire.packet_reader import PacketReader

from tests.zoo.faults.seam import Seam

READS_OBJECT = Seam(decoding, "parse_object")
READS_INIT_PACKET = Seam(decoding, "parse_init_packet")
READS_POSE_THE_SHORT_WAY = Seam(decoding, "plain_pose")
PARSES_JSON = Seam(json_text, "STRICT")
CHECKS_DEPTH = Seam(json_text, "check_depth")
POSE_OF_1_0 = Seam(from_client, "pose_and_timestamp")
POSE_OF_OBJECT = Seam(from_client, "pose_of_object")
NAMES_OF_MEMORY = Seam(init_packet, "SHM_NAME")
VERSIONS_OF_MEMORY = Seam(init_packet, "VERSIONS")
CHECKS_SLOTS = Seam(init_packet, "check_slots")
ENCODES_PACKET = Seam(encoding, "encode_packet")
RECEIVES = Seam(PacketReader, "receive")
NEXT_OF_READER = Seam(PacketReader, "next_packet")
MOST_PAYLOAD_BYTES = Seam(framing, "MAX_PAYLOAD_BYTES")
RECEIVES_BYTES = Seam(PacketDecoder, "receive")
NEXT_PACKET = Seam(PacketDecoder, "next_packet")
COMPARES_TOKENS = Seam(negotiation, "same_token")
POSE_FROM_WIRE = Seam(Engine, "from_wire")
