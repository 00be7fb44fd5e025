"""What the tests of the stand-in share: the library if it can be had, and programs that use it."""

import inspect
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from splatbus_conformance.checks import Check, registry
from splatbus_conformance.images.memory.cuda_stand_in.building import NotAvailable, library_folder
from splatbus_conformance.images.memory.cuda_stand_in.session import StandIn
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.trials.trial import NotObservable, Violation
from splatbus_schemas.requirements import requirements

RUNTIME = Path(__file__).with_name("cuda_runtime.py")


def library() -> str:
    """The path of the library; skips the test where there is no compiler."""
    try:
        return str(library_folder() / "libcudart.so")
    except NotAvailable as error:
        pytest.skip(str(error))


@contextmanager
def stand_in() -> Iterator[StandIn]:
    library()
    found = StandIn()
    try:
        yield found
    finally:
        found.close()


class Program:
    """A process with the library: `program("expression")` evaluates it there.

    It knows `cuda`, `out` (a pointer), `host` (64 KiB) and all of cuda_runtime.py.
    """

    def __init__(self, stand_in: StandIn) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(RUNTIME), library(), "--neighbour"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **stand_in.environment()},
        )

    def send(self, line: str) -> None:
        assert self.process.stdin is not None
        print(line, file=self.process.stdin, flush=True)

    def answer(self) -> Any:
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())

    def __call__(self, line: str) -> Any:
        self.send(line)
        return self.answer()

    def opened(self, handle: bytes) -> int:
        """Open memory; its pointer."""
        code, pointer = self(
            f"(cuda.IpcOpenMemHandle(ctypes.byref(out), as_handle('{handle.hex()}'), 1), out.value)"
        )
        assert code == 0
        return int(pointer)

    def opened_event(self, handle: bytes) -> int:
        """Open an event; its pointer."""
        code, pointer = self(
            f"(cuda.IpcOpenEventHandle(ctypes.byref(out), as_handle('{handle.hex()}')), out.value)"
        )
        assert code == 0
        return int(pointer)

    def copied(self, pointer: int, size: int) -> bytes:
        """Bytes that it copies out of device memory."""
        code, text = self(
            f"(cuda.Memcpy(host, {pointer}, {size}, D2H), bytes(host[:{size}]).hex())"
        )
        assert code == 0
        return bytes.fromhex(text)

    def leave(self) -> int:
        assert self.process.stdin is not None
        self.process.stdin.close()
        status = self.process.wait(30)
        if self.process.stdout is not None:
            self.process.stdout.close()
        return status


@contextmanager
def program(stand_in: StandIn) -> Iterator[Program]:
    found = Program(stand_in)
    try:
        yield found
    finally:
        found.leave()


def checks_in(*modules: ModuleType) -> dict[str, Check]:
    """The checks of these modules, each of one side, by name."""
    return {
        name: check
        for module in modules
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if name.startswith("check_")
        for check in registry.checks_in(function).values()
    }


def judged(
    side: Side, program: Path, checks: Mapping[str, Check], *, adapter: bool = False
) -> dict[str, str]:
    """What each of these checks finds in a program with the stand-in."""
    library()
    command = shlex.join([sys.executable, str(program)])
    size = (64, 48) if side == "client" else (0, 0)
    plan = Plan(side, command, "127.0.0.1", (0, 0), size, 10.0, stand_in_cuda=True)
    return findings_of(replace(plan, launch=None, adapter=command) if adapter else plan, checks)


def findings_of(plan: Plan, checks: Mapping[str, Check]) -> dict[str, str]:
    """What each of these checks finds: an empty text for a pass."""
    testbed = set_up(plan)
    found = {}
    try:
        testbed.introduce()
        for name, check in checks.items():
            assert check.lacks(testbed.facts) is None
            trial = testbed.trial(requirements("1.1")[check.requirement])
            found[name] = ""
            try:
                check.play(trial)
                assert trial.delivered
                if plan.stand_in_cuda and "device" in trial.unseen:
                    trial.not_observable(trial.unseen["device"])
            except Violation as violation:
                found[name] = str(violation)
            except NotObservable as skipped:
                found[name] = f"skipped: {skipped}"
            if testbed.testee.ended():
                trial.end_testee()
    finally:
        testbed.close()
    return found
