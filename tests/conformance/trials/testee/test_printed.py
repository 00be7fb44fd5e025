"""What a testee prints, however much it is: its end, and no more of it in memory."""

import shlex
import sys
import tracemalloc

from splatbus_conformance.trials.testee.process import Launched

from tests.waiting import eventually


def test_the_end_of_much_is_read_alone() -> None:
    program = "import sys; sys.stdout.write('é' * 20_000_000 + 'last words')"
    testee = Launched(f'"{sys.executable}" -c {shlex.quote(program)}', {})
    testee.ensure_running()
    assert eventually(lambda: testee.ended() is not None)
    tracemalloc.start()
    said = testee.output()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    testee.close()
    assert said == ("é" * 2000 + "last words")[-2000:]
    assert most < 1_000_000
