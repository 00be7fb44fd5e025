"""How many camera poses a second go from packet bytes to the view matrix, in one process?

Each way to spell a pose is measured beside plain `json.loads` of the same payloads, turn about. The
fastest round of each counts, since whatever else the machine does only ever adds time; the ratio is
the median of those of the rounds. What is timed is a packet at a time: `receive`, `next_packet`,
decoding with all its checks, `view_matrix`.

    python -m benchmarks wire [--poses 2000] [--rounds 40]

writes `benchmarks/results/wire.json` and `wire.png`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import statistics
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from splatbus_wire.framing import PacketDecoder, encode_packet
from splatbus_wire.messages import decode_from_client
from splatbus_wire.poses import view_matrix

from benchmarks._pictures import pyplot, save

RESULTS = Path(__file__).parent / "results"
GOAL_POSES_PER_SECOND = 100_000

Message = dict[str, Any]


def random_pose(source: random.Random) -> Message:
    position = (source.uniform(-10, 10) for _ in range(3))
    q = [source.gauss(0, 1) for _ in range(4)]
    norm = sum(a * a for a in q) ** 0.5
    return {
        "type": "camera_pose",
        "position": dict(zip("xyz", position, strict=True)),
        "rotation": dict(zip("xyzw", (a / norm for a in q), strict=True)),
    }


def mapped(message: Message, change: Callable[[float], Any]) -> Message:
    vectors = ("position", "rotation")
    return message | {v: {name: change(a) for name, a in message[v].items()} for v in vectors}


def single(number: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", number))[0])


def like_python(message: Message) -> str:
    return json.dumps(message)


def like_unity(message: Message) -> str:
    kind = {"type": message["type"], "timestamp": 12.345678901234567}
    return json.dumps(kind | mapped(message, single), separators=(",", ":"))


def in_another_order(message: Message) -> str:
    return json.dumps(dict(reversed(message.items())))


def like_the_opengl_viewer(message: Message) -> str:
    return json.dumps(mapped(message, lambda number: str(single(number))))


SPELLINGS: dict[str, Callable[[Message], str]] = {
    "Python client": like_python,
    "Unity's client": like_unity,
    "members in another order": in_another_order,
    "OpenGL viewer, numbers as strings": like_the_opengl_viewer,
}


def packets_to_matrices(packets: list[bytes]) -> None:
    decoder = PacketDecoder()
    for packet in packets:
        decoder.receive(packet)
        payload = decoder.next_packet()
        assert payload is not None
        message = decode_from_client(payload, "msg", said_hello=False)
        view_matrix(message.pose)  # type: ignore[union-attr]


def payloads_to_objects(payloads: list[bytes]) -> None:
    for payload in payloads:
        json.loads(payload)


def seconds(work: Callable[[list[bytes]], None], data: list[bytes]) -> float:
    start = time.perf_counter()
    work(data)
    return time.perf_counter() - start


def measure(spelling: Callable[[Message], str], poses: int, rounds: int) -> dict[str, Any]:
    source = random.Random(1)
    payloads = [spelling(random_pose(source)).encode() for _ in range(poses)]
    packets = [encode_packet(payload) for payload in payloads]
    times = [
        (seconds(packets_to_matrices, packets), seconds(payloads_to_objects, payloads))
        for _ in range(rounds)
    ]
    ours, plain = map(min, zip(*times, strict=True))
    return {
        "payload_bytes": round(statistics.mean(map(len, payloads))),
        "poses_per_second": round(poses / ours),
        "json_loads_per_second": round(poses / plain),
        "ratio_of_times": round(statistics.median(a / b for a, b in times), 2),
    }


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
    places = range(len(rows))
    for shift, member, label in (
        (-0.2, "poses_per_second", "bytes to view matrix"),
        (0.2, "json_loads_per_second", "json.loads alone"),
    ):
        bars = axes.barh([y + shift for y in places], [row[member] for row in rows], 0.38)
        bars.set_label(label)
        axes.bar_label(bars, fmt="{:,.0f}", fontsize=8, padding=2)
    axes.axvline(GOAL_POSES_PER_SECOND, color="grey", linestyle=":", label="goal")
    axes.set_yticks(list(places), [row["spelling"] for row in rows])
    axes.invert_yaxis()
    axes.set_xlabel("poses a second")
    axes.margins(x=0.12)
    axes.legend(fontsize=8)
    save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=40)
    options = parser.parse_args()
    rows = []
    for name, spelling in SPELLINGS.items():
        row = {"spelling": name} | measure(spelling, options.poses, options.rounds)
        rows.append(row)
        print(
            f"{name}: {row['poses_per_second']:,} poses a second from bytes to view matrix,"
            f" json.loads alone {row['json_loads_per_second']:,}: {row['ratio_of_times']} of its"
            f" time"
        )
    report = {
        "command": f"python -m benchmarks wire --poses {options.poses} --rounds {options.rounds}",
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "goal_poses_per_second": GOAL_POSES_PER_SECOND,
        "rows": rows,
    }
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "wire.json").write_text(json.dumps(report, indent=1) + "\n")
    draw(rows, RESULTS / "wire.png")


if __name__ == "__main__":
    main()
