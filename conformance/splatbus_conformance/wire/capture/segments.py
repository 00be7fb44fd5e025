"""What TCP sent, as tshark reads it from a capture of any format, on any link."""

import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

SECOND = 1_000_000_000
"""In nanoseconds, in which all times of captures are."""
MAGIC = {
    *map(bytes.fromhex, ("d4c3b2a1", "a1b2c3d4", "4d3cb2a1", "a1b23c4d", "0a0d0d0a")),
}
"""The first bytes of pcap, in either byte order and unit of time, and of pcapng."""
READING_SECONDS = 600.0
TELLS = ("-n", "-o", "tcp.desegment_tcp_streams:FALSE", "-T", "fields", "-E", "occurrence=f")
FIELDS = (
    *("frame.time_relative", "ip.src", "ipv6.src", "tcp.srcport", "ip.dst", "ipv6.dst"),
    *("tcp.dstport", "tcp.seq_raw", "tcp.ack_raw", "tcp.flags", "tcp.len", "tcp.payload"),
)
NOT_QUOTED = "tcp && !icmp && !icmpv6"
"""An error of ICMP has the headers of what it is about."""
FIN, SYN, RST, ACK = 1, 2, 4, 16
MISSING = (
    "reading a capture takes tshark, and there is none: it comes with Wireshark (on Debian "
    "`apt install tshark`), and has to be on the PATH"
)

Endpoint = tuple[str, int]
"""Address and port."""


class CaptureError(ValueError):
    """A capture cannot be read, or holds nothing of these ports; the message says why."""


class Segment(NamedTuple):
    """What TCP sent at once."""

    ns: int
    """Since the first frame of the capture."""
    source: Endpoint
    target: Endpoint
    seq: int
    ack: int | None
    syn: bool
    fin: bool
    rst: bool
    data: bytes
    """As much of its payload as was captured."""
    length: int
    """Bytes of the whole payload."""


def is_capture(path: Path) -> bool:
    """Whether the first bytes of a file are those of a capture. Raises OSError.

    Of what can be read but once, a pipe, nothing is read: it is none.
    """
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(4) in MAGIC


def segments(path: Path, ports: Iterable[int], notes: list[str]) -> Iterator[Segment]:
    """Those from and to these ports; their clock never goes back.

    What tshark says of a file that it reads in part joins the notes. Raises CaptureError, OSError.
    """
    of_ports = " || ".join(f"tcp.port == {port}" for port in ports)
    now = 0
    for row in _rows(path, f"{NOT_QUOTED} && ({of_ports})", FIELDS, notes):
        time, *ends, seq, ack, flags, length, data = row
        if not length:  # it was captured but for a part of its header
            continue
        now = max(now, round(float(time) * SECOND))
        source, target = ((v4 or v6, int(port)) for v4, v6, port in (ends[:3], ends[3:]))
        marks = int(flags, 16)
        yield Segment(
            now,
            source,
            target,
            int(seq),
            int(ack) if marks & ACK else None,
            bool(marks & SYN),
            bool(marks & FIN),
            bool(marks & RST),
            bytes.fromhex(data),
            int(length),
        )


def accepting(path: Path) -> list[int]:
    """The TCP ports that took connections in a capture, or seem to, those with most segments
    first. Raises CaptureError, OSError.
    """
    found: Counter[int] = Counter()
    for source, target, flags in _rows(
        path, NOT_QUOTED, ("tcp.srcport", "tcp.dstport", "tcp.flags")
    ):
        accepts = int(flags, 16) & (SYN | ACK) == SYN | ACK
        found[int(source) if accepts else min(int(source), int(target))] += 1
    return [port for port, _ in found.most_common()]


def _rows(
    path: Path, shown: str, fields: Sequence[str], notes: list[str] | None = None
) -> Iterator[list[str]]:
    line = ["tshark", *TELLS, "-r", str(path), "-Y", shown]
    line += [word for field in fields for word in ("-e", field)]
    with tempfile.TemporaryFile("w+") as rows:
        try:
            ended = subprocess.run(
                line, stdout=rows, stderr=subprocess.PIPE, text=True, timeout=READING_SECONDS
            )
        except FileNotFoundError:
            raise CaptureError(MISSING) from None
        except subprocess.TimeoutExpired:
            raise CaptureError(f"{path}: tshark has not read it in {READING_SECONDS:g} s") from None
        said = [it for it in ended.stderr.splitlines() if it.startswith("tshark: ")]
        if ended.returncode and not rows.tell():
            raise CaptureError(f"{path}: {(said or ['tshark cannot read it'])[-1]}")
        if ended.returncode and notes is not None:
            notes.append(f"what came after: {(said or ['tshark ended early'])[-1]}")
        rows.seek(0)
        for row in rows:
            yield row.rstrip("\n").split("\t")
