"""The generated types compile where they are meant to be used, and are of use there."""

import copy
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from splatbus_schemas import LIMITS, VERSIONS, examples, names, read_json
from splatbus_schemas.model.metamodel import metamodel
from splatbus_schemas.model.parts import camel
from splatbus_schemas.types.__main__ import LANGUAGES, main

COMPILERS = {
    "csharp": ("mcs", "-target:library", "-warn:4", "-warnaserror", "-out:types.dll", "types.cs"),
    "cpp": ("g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "use.cpp"),
    "typescript": ("tsc", "--strict", "--noEmit", "--lib", "es2015", "types.ts"),
}
PROGRAMS = Path(__file__).parent / "programs"
FILES = {"csharp": "types.cs", "cpp": "types.hpp", "typescript": "types.ts"}


def compiled(language: str, folder: Path, *more: str) -> None:
    """Run the compiler of a language in a folder; skips where there is none."""
    command, *arguments = COMPILERS[language]
    if not shutil.which(command):
        pytest.skip(f"{command} is not installed")
    done = subprocess.run(
        [command, *arguments, *more], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr


def printed(folder: Path, *command: str) -> list[str]:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def generated(language: str, version: str, folder: Path) -> str:
    target = folder / FILES[language]
    assert main([language, "--version", version, "--output", str(target)]) == 0
    return target.read_text("utf-8")


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("language", ["csharp", "cpp"])  # the third, with the examples
def test_they_compile(language: str, version: str, tmp_path: Path) -> None:
    generated(language, version, tmp_path)
    (tmp_path / "use.cpp").write_text('#include "types.hpp"\n#include "types.hpp"\n')
    compiled(language, tmp_path)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("language", LANGUAGES)
def test_they_have_all_objects_members_and_limits(
    language: str, version: str, tmp_path: Path
) -> None:
    text = generated(language, version, tmp_path)
    model = metamodel()["versions"][version]
    for name, record in model["records"].items():
        assert re.search(rf"\b(class|struct|using|interface|type) {name}\b", text)
        for member in record["members"]:
            assert camel(member["name"]) in text or member["name"] in text
            assert all(each in text for each in member["requirements"])
    known = {
        n for n, each in read_json("limits.json")["limits"].items() if each["since"] <= version
    }
    for name in LIMITS:
        assert (name in text or camel(name) in text) == (name in known), name


def test_they_are_printed_without_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cpp"]) == 0
    assert "// SplatBus 1.1. Generated" in capsys.readouterr().out


@pytest.mark.parametrize("version", VERSIONS)
def test_limits_in_csharp_are_int_where_one_can_be(version: str, tmp_path: Path) -> None:
    text = generated("csharp", version, tmp_path)
    kinds: dict[str, list[float]] = {}
    for kind, value in re.findall(r"const (\w+) \w+ = ([\d.e+-]+);", text):
        kinds.setdefault(kind, []).append(float(value))
    assert kinds.keys() == {"int", "long", "double"}
    assert max(kinds["int"]) < 2**31 <= min(kinds["long"])


def test_a_program_in_csharp(tmp_path: Path) -> None:
    generated("csharp", "1.1", tmp_path)
    shutil.copy(PROGRAMS / "use.cs", tmp_path)
    compiled("csharp", tmp_path, "-target:exe", "-out:use.exe", "use.cs")
    told = ["frame 7 a", "host_shm splat 3", "Error", "mem_color colorOffset", "1048576 6001 5"]
    assert printed(tmp_path, "mono", "use.exe") == told


def test_a_program_in_cpp(tmp_path: Path) -> None:
    generated("cpp", "1.1", tmp_path)
    shutil.copy(PROGRAMS / "use.cpp", tmp_path)
    compiled("cpp", tmp_path)
    printed(tmp_path, "g++", "-std=c++17", "use.cpp", "-o", "use")
    assert printed(tmp_path, "./use") == ["frame 7 a", "host_shm splat 3", "busy"]


def test_a_program_in_typescript(tmp_path: Path) -> None:
    generated("typescript", "1.1", tmp_path)
    shutil.copy(PROGRAMS / "use.ts", tmp_path)
    compiled("typescript", tmp_path, "use.ts")


def is_missing(pointer: str, message: Any) -> bool:
    """Whether a JSON pointer leads to a member that is not there."""
    *path, last = pointer.split("/")[1:] or [""]
    for step in path:
        message = message[int(step) if isinstance(message, list) else step]
    return isinstance(message, dict) and last not in message


def uses_of_examples(version: str) -> Iterator[str]:
    """The valid examples as what they are, and those that lack a member as what they are not."""
    records = metamodel()["versions"][version]["records"].values()
    depending = {
        m["name"] for r in records for m in r["members"] if {"when", "requiredWhen"} & {*m}
    }
    yield 'import * as types from "./types";'
    yield "const take = <T>() => <V extends T>(value: V) => value;"
    for name in names(version):
        valid, invalid = examples(name, version)
        for right in valid:
            message = copy.deepcopy(right.message)
            if "mem_color" not in message:  # then events may be anything
                message.get("ring", {}).pop("events", None)
            yield f"take<types.{camel(name)}>()({json.dumps(message)});"
        for wrong in invalid:
            member = wrong.pointer.split("/")[-1]
            if is_missing(wrong.pointer, wrong.message) and member not in depending:
                yield "// @ts-expect-error"
                yield f"take<types.{camel(name)}>()({json.dumps(wrong.message)});"


@pytest.mark.parametrize("version", VERSIONS)
def test_typescript_takes_and_refuses_the_examples(version: str, tmp_path: Path) -> None:
    generated("typescript", version, tmp_path)
    lines = list(uses_of_examples(version))
    assert any(line.startswith("//") for line in lines)
    (tmp_path / "use.ts").write_text("\n".join(lines), "utf-8")
    compiled("typescript", tmp_path, "use.ts")
