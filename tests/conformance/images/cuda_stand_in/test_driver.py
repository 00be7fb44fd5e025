"""The stand-in's driver beside a real one, and what it leaves in the trace."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance.images.memory.cuda_stand_in.building import DRIVER
from splatbus_conformance.images.memory.cuda_stand_in.session import StandIn

from tests.conformance.images.cuda_stand_in.cuda_driver import GROUPS, START
from tests.conformance.images.cuda_stand_in.cuda_runtime import answers
from tests.conformance.images.cuda_stand_in.library import library, stand_in

REAL = json.loads(
    Path(__file__).parents[3].joinpath("data", "cuda_driver_answers.json").read_text("utf-8")
)["answers"]


def driver() -> str:
    return str(Path(library()).with_name(DRIVER))


def evaluated(stand_in: StandIn, *lines: str) -> list[Any]:
    """What a process with the driver, and with device 0 current, makes of expressions."""
    ran = subprocess.run(
        [*START, driver(), "--neighbour"],
        input="\n".join(lines),
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **stand_in.environment()},
        timeout=60,
    )
    return [json.loads(line) for line in ran.stdout.splitlines()]


@pytest.mark.parametrize("group", [each.__name__ for each in GROUPS])
def test_answers_as_a_real_driver(group: str) -> None:
    with stand_in() as it:
        found = answers(driver(), group, START, **it.environment())
    assert found == REAL[group]
    assert list(found) == list(REAL[group])


def test_a_call_leaves_the_line_of_the_runtimes() -> None:
    with stand_in() as it:
        memory = it.device.allocate(64)
        memory.write(16, b"from the harness")
        opened, copied, text = evaluated(
            it,
            f"cuda.IpcOpenMemHandle(ctypes.byref(out), as_handle('{memory.handle.hex()}'), 1)",
            "(h := ctypes.create_string_buffer(16), cuda.MemcpyDtoHAsync(h, out.value + 16, 16, 0),"
            " globals().update(h=h))[1]",
            "h.raw.decode()",
        )
        assert (opened, copied, text) == (0, 0, "from the harness")
        calls = [call for call in it.calls() if call.memory == memory.name]
    assert [call.function for call in calls] == ["cudaIpcOpenMemHandle", "cudaMemcpyAsync"]
    assert (calls[1].offset, calls[1].width, calls[1].device) == (16, 16, 0)


def test_memory_is_opened_on_the_device_of_the_current_context() -> None:
    with stand_in() as it:
        memory = it.device.allocate(64)
        evaluated(
            it,
            "cuda.CtxPushCurrent(cuda.made('DevicePrimaryCtxRetain', 1))",
            f"cuda.IpcOpenMemHandle(ctypes.byref(out), as_handle('{memory.handle.hex()}'), 1)",
        )
        (call,) = (it for it in it.calls() if it.function == "cudaIpcOpenMemHandle")
    assert call.device == 1


def test_devices_have_the_uuids_that_the_harness_announces() -> None:
    with stand_in() as it:
        told = evaluated(
            it,
            *(
                f"(t := (ctypes.c_ubyte * 16)(), cuda.DeviceGetUuid(t, {which}), bytes(t).hex())[2]"
                for which in (0, 1)
            ),
        )
        assert told[0] == it.device.uuid.removeprefix("GPU-").replace("-", "")
    assert told[1] != told[0]


def test_a_program_that_only_looks_for_a_driver_has_not_used_it() -> None:
    """A runtime that is linked statically does so, and is not the stand-in's."""
    line = f"import ctypes; ctypes.CDLL({driver()!r}).cuInit(0)"
    with stand_in() as it:
        subprocess.run(
            [sys.executable, "-c", line], check=True, env={**os.environ, **it.environment()}
        )
        assert not it.calls()
