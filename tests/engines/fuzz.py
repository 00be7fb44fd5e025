"""`python -m tests.engines.fuzz --minutes 10`: the C++ client's sessions, fed with whatever.

libFuzzer changes the packets of all examples of the standard, good and bad, under AddressSanitizer
and UndefinedBehaviorSanitizer; what came of it is stored.
"""

import argparse
import json
import re
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from splatbus_schemas import examples, names
from splatbus_schemas.prose import CHECKOUT
from splatbus_wire.framing import encode_packet

from tests.engines.built import CPP, compiled_cpp

RESULT = CHECKOUT / "tests" / "results" / "cpp-fuzz.json"
OPTIONS = ("-O1", "-g", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")
IPC = {"welcome", "init_packet", "frame", "error"}
LONGEST = 8192
"""Bytes of an input."""


def corpus() -> Iterator[bytes]:
    """How an input is to be taken, and a packet: see fuzz/client.cpp."""
    for version in ("1.0", "1.1"):
        for name in names(version):
            for example in (each for group in examples(name, version) for each in group):
                packet = encode_packet(json.dumps(example.message).encode())
                yield from (
                    bytes([how]) + packet for how in ((1, 3, 7) if name in IPC else (0, 2, 6))
                )


def run(folder: Path, *limits: str, seconds: float = 600) -> tuple[int, str]:
    """Status and output of the fuzzer within these limits; what it finds is kept there."""
    target = compiled_cpp(CPP / "fuzz" / "client.cpp", "clang++", OPTIONS)
    inputs = folder / "corpus"
    inputs.mkdir()
    for number, each in enumerate(corpus()):
        (inputs / str(number)).write_bytes(each)
    line = [str(target), str(inputs), f"-max_len={LONGEST}", *limits]
    done = subprocess.run(
        line, cwd=folder, capture_output=True, text=True, errors="replace", timeout=seconds
    )
    return done.returncode, done.stderr


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.engines.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10)
    minutes = parser.parse_args().minutes
    with tempfile.TemporaryDirectory() as scratch:
        status, told = run(
            Path(scratch),
            f"-max_total_time={int(60 * minutes)}",
            "-print_final_stats=1",
            seconds=60 * minutes + 300,
        )
        found = re.search(r"Done (\d+) runs", told)
    if status or not found:
        print(told[-6000:])
        return 1
    result = {
        "command": f"python -m tests.engines.fuzz --minutes {minutes:g}",
        "sanitizers": "address, undefined",
        "runs": int(found[1]),
        "faults": 0,
    }
    RESULT.write_text(json.dumps(result, indent=1) + "\n", "utf-8")
    print(f"{int(found[1]):,} runs, no fault")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
