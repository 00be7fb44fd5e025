"""Mutants that break LIM and SEC: they keep too much, or can be reached from everywhere."""

from splatbus_schemas import LIMITS
from splatbus_server import connection

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant


@mutant("LIM-1", check="check_connections_are_limited", code="not-limited")
def server_keeps_every_connection(patch):
    """Has no limit of connections."""
    server.MOST_CONNECTIONS.replace(patch, 100_000)


@mutant("LIM-2", check="check_who_never_reads_is_closed", code="hangs", at=server.COUNTS_SENT)
def server_keeps_every_reply(original, self, count, now):
    """Keeps replies for a client that does not read, however many and however long."""
    del self.unsent[:count]


@mutant("LIM-2", check="check_who_stops_reading_is_closed", code="hangs")
def server_waits_for_who_reads_nothing(patch):
    """Keeps what it may keep for a client that does not read, however long."""
    Seam(connection, "LIMITS").replace(patch, {**LIMITS, "stalled_reader_seconds": 1e6})


@mutant("SEC-1", check="check_listens_on_loopback_alone", code="beyond-loopback")
def server_listens_everywhere(patch):
    """Listens on every address, whatever it is told."""
    server.LISTENS.wrap(patch, lambda original, host, port: original("0.0.0.0", port))
