"""Compiles the plugin against the stub, and writes the headers that Unreal's header tool would."""

import re
from collections.abc import Sequence
from pathlib import Path

from tests.engines.built import CHECKED, CPP, kept, texts

UNREAL = CPP / "unreal"
PLUGIN = UNREAL / "SplatBus"
MODULE = PLUGIN / "Source" / "SplatBus"
SHADERS = PLUGIN / "Shaders" / "Private"
STUB = Path(__file__).parent / "stub"
DRIVER = Path(__file__).parent / "driver.cpp"
LANGUAGE = ("-std=c++20", "-fno-exceptions", "-fno-rtti")
WARNINGS = ("-Wall", "-Wextra", "-Wshadow", "-Werror")
REFLECTED = re.compile(
    r"^U(CLASS|STRUCT)\(.*\)\n(?:class|struct) SPLATBUS_API (\w+)(?: : public (\w+))?", re.M
)
COUNTED = "#undef GENERATED_BODY\n#define GENERATED_BODY() "


def sources() -> list[Path]:
    return sorted(MODULE.rglob("*.cpp"))


def headers() -> list[Path]:
    return sorted(MODULE.rglob("*.h"))


def generated(header: Path) -> str | None:
    """What stands for the header's `.generated.h`; none where it has nothing to reflect."""
    found = REFLECTED.findall(header.read_text("utf-8"))
    if not found:
        return None
    ((kind, name, base),) = found
    if kind == "STRUCT":
        return "#pragma once\n" + COUNTED + "static_assert(true);\n"
    default = f"static {name}* StubDefault() {{ static {name} It; return &It; }}"
    return f"#pragma once\n{COUNTED}public: using Super = {base}; {default} private:\n"


def compiled(name: str, source: str | Path, options: Sequence[str], folder: Path) -> Path:
    """What the compiler makes of it in this folder; a warning is an error."""
    for each in headers():
        if (text := generated(each)) is not None:
            (folder / f"{each.stem}.generated.h").write_text(text, "utf-8")
    places = (MODULE / "Public", MODULE / "Private", STUB, CPP / "include", ".")
    line = ["g++", *LANGUAGE, *WARNINGS, "-pthread", *(f"-I{each}" for each in places)]
    of = [*texts(folder), *texts(STUB.parent), *texts(CPP)]
    return kept(name, [*line, *options, str(source)], of, folder)


def driver(folder: Path) -> Path:
    """The program that runs a view, all of it in one unit, as Unreal's build tool has it."""
    text = "".join(f'#include "{each}"\n' for each in (*sources(), DRIVER))
    (folder / "everything.cpp").write_text(text, "utf-8")
    return compiled("unreal", "everything.cpp", CHECKED, folder)
