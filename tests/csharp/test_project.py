"""The project file of the C# client, read: there is no .NET SDK here that could build it."""

import json
import subprocess
from xml.etree import ElementTree

from splatbus_schemas.prose import CHECKOUT

from tests.csharp.compiled import FOLDER
from tests.csharp.unity_stub.metas import sources

CLIENT = FOLDER / "SplatBus.Client"
PROJECT = ElementTree.parse(CLIENT / "SplatBus.Client.csproj").getroot()
"""Nothing in it is in a namespace, which the SDK does not ask for."""


def said(name: str) -> str:
    """What the file says of a property, which it sets once."""
    (found,) = PROJECT.iter(name)
    assert found.text
    return found.text


def test_it_is_the_package_that_unity_has() -> None:
    theirs = json.loads((FOLDER / "package.json").read_text("utf-8"))
    assert said("Version") == theirs["version"]
    assert said("PackageLicenseExpression") == theirs["license"] == "MIT"
    assert said("PackageTags").split(";") == theirs["keywords"]
    (assembly,) = CLIENT.glob("*.asmdef")
    named = json.loads(assembly.read_text("utf-8"))
    assert named["name"] == said("PackageId") == CLIENT.name
    assert named["rootNamespace"] == said("RootNamespace")


def test_the_sdk_takes_the_sources_that_unity_takes() -> None:
    """All below the folder, but for what is built; Unity leaves out more."""
    assert not list(PROJECT.iter("Compile"))
    assert not list(PROJECT.iter("EnableDefaultItems"))
    assert not list(PROJECT.iter("EnableDefaultCompileItems"))
    everything = {each for each in CLIENT.rglob("*.cs") if not set(each.parts) & set(outputs())}
    assert everything == set(sources(CLIENT))
    assert len(everything) > 20


def outputs() -> list[str]:
    """The folders into which it builds."""
    return [said(each).rstrip("/") for each in ("BaseOutputPath", "BaseIntermediateOutputPath")]


def test_what_it_builds_is_nothing_to_unity_and_git() -> None:
    """Both folders have to be said before the SDK's own properties, which go by them."""
    first, sdk, *_ = PROJECT
    assert [each.tag for each in first] == ["BaseOutputPath", "BaseIntermediateOutputPath"]
    assert sdk.attrib == {"Project": "Sdk.props", "Sdk": "Microsoft.NET.Sdk"}
    assert PROJECT[-1].attrib == {"Project": "Sdk.targets", "Sdk": "Microsoft.NET.Sdk"}
    assert "Sdk" not in PROJECT.attrib
    for name in outputs():
        assert name.endswith("~")  # what Unity does not import
        line = ["git", "check-ignore", "--quiet", str(CLIENT / name / "SplatBus.Client.dll")]
        assert subprocess.run(line, cwd=CHECKOUT).returncode == 0, name
