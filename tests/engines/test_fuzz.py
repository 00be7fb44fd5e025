"""A short look with the fuzzer; see tests/engines/fuzz.py for a long one."""

from pathlib import Path

import pytest

from tests.engines.fuzz import corpus, run

RUNTIMES = list(Path("/usr/lib").glob("llvm-*/lib/clang/*/lib/linux/libclang_rt.fuzzer-*.a"))


@pytest.mark.skipif(not RUNTIMES, reason="clang's libFuzzer is not installed")
def test_no_bytes_of_a_server_are_a_fault_of_the_cpp_client(tmp_path: Path) -> None:
    assert sum(1 for _ in corpus()) > 1000
    status, told = run(tmp_path, "-runs=30000", "-seed=1")
    assert status == 0, told[-6000:]
    assert "Done 3" in told
