"""Foreign programs: small clients and servers in many languages that share no code with ours.

Each is a folder with its source and a `program.toml`:

    side = "client"                  which of the two it is
    language = "C"
    what = "a viewer that ..."       one line about it
    each_time = "Go; ..."            why the test command judges it, and not `tests long` alone
    traffic = ["REQ-13"]             whose checks bring out what rules find; the test command
                                     judges what does not conform by these and by what is pinned
    profile = "quick"                by which it does: the shortest that finds all; brief if absent
    build = ["gcc", "client.c", "-o", "{built}/client"]    absent where there is nothing to build
    launch = "{built}/client"
    needs = ["gcc"]                  programs that have to be on PATH
    options = ["--stand-in-cuda"]    for the harness
    press = true                     judged with --wait: started only when the harness says so
    conforms = false                 not one MUST is broken
    environment = {NAME = "value"}   for the harness and the program

    [[defect]]                       what it does wrong, a SHOULD too
    requirement = "JSN-4"
    wrong = "sends every number as a string"
    deployed = "OpenGL viewer"       who was seen to do so
    also = ["ACC-1"]                 what is bound to break with it

    [verdict]                        what the harness must say, exactly
    fails = ["ACC-1", "JSN-4"]
    warns = []
    exit = 3                         the exit status, where that does not follow
    says = ["status 1"]              what is printed, among other things
    slow = []                        those of them that only the profile `full` is sure to find

`{folder}` is the program's own folder, in which it is built, `{built}` where what is built goes,
`{cudart}` the folder of a `libcudart.so`, and `{python}` a Python that has only its own library.
"""

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from splatbus_conformance.data import cache_folder
from splatbus_conformance.images.memory.cuda_stand_in.building import NotAvailable, library_folder

from tests.foreign.pressing import pressed

HERE = Path(__file__).parent
FOLDERS = {"client": HERE / "clients", "server": HERE / "servers"}
MEMORY = Path("/dev/shm")
BUILD_SECONDS = 300
RUN_SECONDS = 1800
MOST_STARTS = 4
"""What a person in front of an engine may be asked for in one quick run."""


class Lacking(Exception):  # noqa: N818 - a finding, no error of ours
    """What the program needs and this machine has not."""


@dataclass(frozen=True)
class Defect:
    """One thing that a program does wrong."""

    requirement: str
    wrong: str
    deployed: str = ""
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class Program:
    """A foreign program, as its `program.toml` has it."""

    folder: Path
    side: str
    language: str
    what: str
    launch: str
    conforms: bool
    fails: frozenset[str]
    warns: frozenset[str]
    slow: frozenset[str] = frozenset()
    build: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    press: bool = False
    environment: dict[str, str] = field(default_factory=dict)
    defects: tuple[Defect, ...] = ()
    exit: int | None = None
    each_time: str = ""
    traffic: tuple[str, ...] = ()
    profile: str = "brief"
    says: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """What its folder is called."""
        return self.folder.name

    @property
    def selection(self) -> tuple[str, ...]:
        """Options of the harness for what has to be judged to see all that is pinned."""
        pinned = sorted((self.fails | self.warns) - self.slow)
        if self.conforms or not pinned:
            return ()
        return "--select", ",".join([*pinned, *self.traffic])


def programs(side: str) -> list[Program]:
    """All programs of one side, by name."""
    return [read(path.parent) for path in sorted(FOLDERS[side].glob("*/program.toml"))]


def read(folder: Path) -> Program:
    """The program of a folder."""
    text: dict[str, Any] = tomllib.loads((folder / "program.toml").read_text("utf-8"))
    verdict = text.pop("verdict")
    defects = [
        Defect(**{**defect, "also": tuple(defect.get("also", ()))})
        for defect in text.pop("defect", ())
    ]
    lists = {name: tuple(text.pop(name, ())) for name in ("build", "needs", "options", "traffic")}
    return Program(
        folder=folder,
        fails=frozenset(verdict.pop("fails")),
        warns=frozenset(verdict.pop("warns")),
        says=tuple(verdict.pop("says", ())),
        slow=frozenset(verdict.pop("slow", ())),
        defects=tuple(defects),
        **lists,
        **text,
        **verdict,
    )


def command(program: Program) -> str:
    """The command that starts it, built if need be; raises Lacking."""
    if missing := [name for name in program.needs if shutil.which(name) is None]:
        raise Lacking(f"there is no {' and no '.join(missing)}")
    places = {"folder": str(program.folder), "python": f"{shlex.quote(sys.executable)} -I -S"}
    if program.build:
        places["built"] = str(_built(program, places))
    return program.launch.format(**places)


def _built(program: Program, places: dict[str, str]) -> Path:
    """The folder with what was built: in the user's cache, under a digest of the sources."""
    if any("{cudart}" in word for word in program.build):
        try:
            places = {**places, "cudart": str(library_folder())}
        except NotAvailable as error:
            raise Lacking(str(error)) from None
    named = (program.folder / word for word in program.build)  # also what is borrowed
    sources = sorted(path for path in {*program.folder.rglob("*"), *named} if path.is_file())
    digest = hashlib.blake2b(repr(program.build).encode(), digest_size=8)
    for path in sources:
        digest.update(path.name.encode() + path.read_bytes())
    folder = cache_folder().with_name("splatbus-foreign") / f"{program.name}-{digest.hexdigest()}"
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    building = Path(tempfile.mkdtemp(prefix="building-", dir=folder.parent))
    words = [word.format(**places, built=building) for word in program.build]
    try:
        built = subprocess.run(
            words, cwd=program.folder, capture_output=True, text=True, timeout=BUILD_SECONDS
        )
        if built.returncode:
            raise RuntimeError(f"{shlex.join(words)}\n{built.stdout}{built.stderr}")
        building.rename(folder)
    except OSError:
        if not folder.is_dir():  # else somebody else was quicker, with the same result
            raise
    finally:
        shutil.rmtree(building, ignore_errors=True)
    return folder


def judge(
    program: Program, scratch: Path, *more: str, profile: str = "quick", seed: int = 0
) -> dict[str, Any]:
    """The report of it as `--json` has it, with what was `printed` and its `starts` by hand."""
    start = command(program)
    report = scratch / "report.json"
    words = [sys.executable, "-m", "splatbus_conformance", "--plain", program.side]
    words += ["--wait"] if program.press else ["--launch", start]
    words += ["--json", str(report), "--scripts", str(scratch / "failures"), "--shrink", "0"]
    words += ["--seed", str(seed), "--profile", profile, *program.options, *more]
    starts = 0
    if program.press:
        printed, starts = pressed(words, start, scratch, RUN_SECONDS)
    else:
        printed = subprocess.run(
            words,
            cwd=scratch,
            env={**os.environ, **program.environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            timeout=RUN_SECONDS,
        ).stdout
    for left in MEMORY.glob(f"splatbus-{program.name}-*"):  # one that breaks OPN-9 sweeps nothing
        left.unlink(missing_ok=True)
    if not report.is_file():
        raise RuntimeError(f"no report was written\n{printed}")
    judged: dict[str, Any] = json.loads(report.read_text("utf-8"))
    return {**judged, "printed": printed, "starts": starts}


def differences(program: Program, report: dict[str, Any]) -> list[str]:
    """What the report says otherwise than it must, a sentence each."""
    found: list[str] = []
    late = frozenset() if report["profile"] == "full" else program.slow
    for verdict, pinned in (("fail", program.fails), ("warn", program.warns)):
        said = _said(report, verdict)
        found += [
            f"{name} has the verdict {verdict}, and must not: {said[name]}"
            for name in said
            if name not in pinned
        ]
        found += [
            f"{name} must have the verdict {verdict}, and has {_verdict(report, name)}"
            for name in sorted(pinned - late - set(said))
        ]
    if program.exit is None:
        found += [f"the harness failed: {it}" for it in _said(report, "harness-error").values()]
    found += [f"it must say {text!r}" for text in program.says if text not in report["printed"]]
    if report["profile"] != "full" and report["starts"] > MOST_STARTS:
        found.append(f"Play had to be pressed {report['starts']} times, and {MOST_STARTS} will do")
    expected = int(bool(_said(report, "fail"))) if program.exit is None else program.exit
    if report["exitCode"] != expected:
        found.append(f"the run is to end with {expected}, and ends with {report['exitCode']}")
    return found


def _said(report: dict[str, Any], verdict: str) -> dict[str, str]:
    """Each requirement with this verdict, and the first line of what was said of it."""
    results = [
        (requirement["id"], result)
        for requirement in report["requirements"]
        for result in requirement["results"]
    ] + [(result["requirement"] or "the run itself", result) for result in report["others"]]
    said: dict[str, str] = {}
    for name, result in results:
        if result["verdict"] == verdict:
            first = (result["text"].splitlines() or [""])[0]
            said.setdefault(name, f"{result['check']} says: {first}")
    return said


def _verdict(report: dict[str, Any], name: str) -> str:
    verdicts = {each["id"]: each["verdict"] for each in report["requirements"]}
    return str(verdicts.get(name, "none: it is not judged"))
