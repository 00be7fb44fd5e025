"""The C++ client's sessions, fed with whatever.

libFuzzer changes the packets of all examples of the standard, good and bad, under AddressSanitizer
and UndefinedBehaviorSanitizer.
"""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from splatbus_schemas import examples, names
from splatbus_wire.framing import encode_packet

from tests.engines.built import CPP, compiled_cpp

RUNTIMES = list(Path("/usr/lib").glob("llvm-*/lib/clang/*/lib/linux/libclang_rt.fuzzer-*.a"))
OPTIONS = ("-O1", "-g", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")
IPC = {"welcome", "init_packet", "frame", "error"}
LIMITS = ("-runs=30000", "-seed=1", "-max_len=8192")


def corpus() -> Iterator[bytes]:
    """How an input is to be taken, and a packet: see fuzz/client.cpp."""
    for version in ("1.0", "1.1"):
        for name in names(version):
            for example in (each for group in examples(name, version) for each in group):
                packet = encode_packet(json.dumps(example.message).encode())
                yield from (
                    bytes([how]) + packet for how in ((1, 3, 7) if name in IPC else (0, 2, 6))
                )


@pytest.mark.skipif(not RUNTIMES, reason="clang's libFuzzer is not installed")
def test_no_bytes_of_a_server_are_a_fault_of_the_cpp_client(tmp_path: Path) -> None:
    target = compiled_cpp(CPP / "fuzz" / "client.cpp", "clang++", OPTIONS)
    (inputs := tmp_path / "corpus").mkdir()
    for number, each in enumerate(corpus()):
        (inputs / str(number)).write_bytes(each)
    assert number > 1000
    line = [str(target), str(inputs), *LIMITS]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, timeout=600)
    told = done.stderr.decode(errors="replace")
    assert done.returncode == 0, told[-6000:]
    assert "Done 3" in told
