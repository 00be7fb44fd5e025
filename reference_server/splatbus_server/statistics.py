"""What a server did, and what it did not need to do."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Statistics:
    """Counts since the start; each is written by one thread only.

    Attributes:
        connections: accepted, on both channels.
        requests: answered.
        poses_received: valid poses, of camera and objects, and times, of the connection in control.
        poses_superseded: of these, never rendered, because a newer one came first.
        views: handed out to the renderer.
        frames_published: images written to a slot.
        colors_converted: of these, with colour.
        depths_converted: of these, with depth.
        frames_sent: leases given to clients.
        series_computed: of telemetry, because a client had subscribed to them.
        telemetry_sent: messages of it.
        refused: packets and connections not served, by the error's code.
    """

    connections: int = 0
    requests: int = 0
    poses_received: int = 0
    poses_superseded: int = 0
    views: int = 0
    frames_published: int = 0
    colors_converted: int = 0
    depths_converted: int = 0
    frames_sent: int = 0
    series_computed: int = 0
    telemetry_sent: int = 0
    refused: Counter[str] = field(default_factory=Counter)
