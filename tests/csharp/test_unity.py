"""The Unity package, without Unity: compiled against a stub, run on it, its shader run as C++."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from splatbus_server import Intrinsics, Semantics

from tests.csharp.unity_stub.building import STUB, UNITY, asmdefs, mcs, refers_to, sources_of
from tests.csharp.unity_stub.metas import PACKAGE, assets, meta, text
from tests.csharp.unity_stub.running import (
    IN_UNITY,
    SETTING,
    Renderer,
    check_matrices,
    component,
    rendered,
    stepped,
    wire_pose,
)
from tests.engines import shading
from tests.engines.judging import check_conforms
from tests.engines.stage import HEIGHT, WIDTH, serving
from tests.waiting import eventually

SHADERS = UNITY / "Runtime" / "Shaders"
SHADER = SHADERS / "Resources" / "SplatBusComposite.shader"
OFF_THE_MIDDLE = Intrinsics(50.0, 40.0, 20.0, 10.0)
FRAMES = 3_000
SMALL_NURSERY = {"MONO_GC_PARAMS": "nursery-size=64k"}
"""Bytes of garbage after which the collector runs."""
NO_MATRIX = 16 * [0]


@pytest.mark.parametrize("urp", ["12.1.7", "14.0.11"])
def test_each_assembly_compiles_against_what_it_references(urp: str, tmp_path: Path) -> None:
    """In the order of their references, with the defines that this URP makes."""
    newer = ["-d:SPLATBUS_URP_HANDLES"] * (urp > "13")
    engine = mcs(tmp_path / "UnityEngine.dll", "-target:library", STUB / "UnityEngine.cs")
    library = ["-target:library", f"-r:{engine}"]
    stubs = {"UnityEngine": engine}
    for name in ("UnityEditor", "Universal"):
        stubs[name] = mcs(tmp_path / f"{name}.dll", *library, *newer, STUB / f"{name}.cs")
    built: dict[str, Path] = {}
    waiting = asmdefs()
    while waiting:
        name = next(n for n, (_, said) in waiting.items() if refers_to(said) <= built.keys())
        folder, said = waiting.pop(name)
        references = [built[each] for each in refers_to(said)]
        if not said.get("noEngineReferences"):
            references.append(stubs["UnityEngine"])
        if said.get("includePlatforms") == ["Editor"]:
            references.append(stubs["UnityEditor"])
        if any("Universal" in each for each in said.get("references", ())):
            references.append(stubs["Universal"])
        defines = [f"-d:{each}" for each in said.get("defineConstraints", ())]
        line: list[str | Path] = [
            *defines,
            *newer,
            *(f"-r:{each}" for each in references),
            *sources_of(folder),
        ]
        built[name] = mcs(tmp_path / f"{name}.dll", "-target:library", *line)
    assert set(built) == {
        "SplatBus.Client",
        "SplatBus.Unity",
        "SplatBus.Unity.Editor",
        "SplatBus.Unity.Universal",
    }
    for sample in UNITY.glob("Samples~/*"):
        mcs(tmp_path / "sample.dll", *library, *sample.glob("*.cs"))


def test_defines_are_those_that_packages_make() -> None:
    """A constraint that nothing defines would leave an assembly out, without a word."""
    for folder, said in asmdefs().values():
        made = {each["define"] for each in said.get("versionDefines", ())}
        assert set(said.get("defineConstraints", ())) <= made
        text = "".join(each.read_text("utf-8") for each in sources_of(folder))
        assert set(re.findall(r"^#if !?(\w+)", text, re.MULTILINE)) <= made


def test_every_asset_has_a_meta_file_and_no_other_is_left() -> None:
    """`python -m tests.csharp.unity_stub.metas` renews them."""
    wanted = {meta(each): text(each) for each in assets()}
    there = {each: each.read_text("utf-8") for each in PACKAGE.rglob("*.meta")}
    assert there == wanted
    assert len({each.split()[3] for each in there.values()}) == len(there)


def test_the_shader_has_what_the_component_sets_and_a_part_for_each_pipeline() -> None:
    shader = SHADER.read_text("utf-8")
    code = [shader, *(each.read_text("utf-8") for each in SHADERS.glob("*.hlsl"))]
    for each in code:
        for opening, closing in ("{}", "()", "[]"):
            assert each.count(opening) == each.count(closing)
        assert each.count("#if") == each.count("#endif")
    runtime = "".join(each.read_text("utf-8") for each in (UNITY / "Runtime").glob("*.cs"))
    declared = re.findall(r"^[\w<>]+ (_\w+);", "\n".join(code), re.MULTILINE)
    assert sorted(declared) == sorted(re.findall(r'PropertyToID\("(\w+)"\)', runtime))
    for include in re.findall(r'#include "(\.\./\w+\.hlsl)"', shader):
        assert (SHADER.parent / include).is_file()
    (name,) = re.findall(r'^Shader "([^"]+)"', shader, re.MULTILINE)
    assert f'ShaderName = "{name}"' in runtime
    universal, builtin = shader.split("SubShader")[1:]
    assert '"RenderPipeline" = "UniversalPipeline"' in universal
    assert "PackageRequirements" in universal
    assert "HLSLPROGRAM" in universal
    assert "RenderPipeline" not in builtin
    assert "CGPROGRAM" in builtin


@pytest.fixture(scope="module")
def screen(tmp_path_factory: pytest.TempPathFactory) -> shading.Screen:
    return shading.compiled(tmp_path_factory.mktemp("shader"), SHADERS / "Pixel.hlsl", "_##it")


@pytest.mark.parametrize("alpha", shading.ALPHAS)
@pytest.mark.parametrize("space", shading.SPACES)
@pytest.mark.parametrize("kind", shading.DEPTHS)
@pytest.mark.parametrize("here", shading.SPACES)
def test_the_shader_mixes_as_the_viewer_does(
    alpha: str, space: str, kind: str, here: str, screen: shading.Screen
) -> None:
    semantics = Semantics(alpha, space, kind, depth_empty=100.0)
    shading.check_mixes(screen, semantics, here, 2.5, upside_down=True)


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folders = (PACKAGE / "SplatBus.Client", UNITY / "Runtime")
    sources = [each for folder in folders for each in sources_of(folder)]
    target = tmp_path_factory.mktemp("unity") / "driver.exe"
    return mcs(target, *sources, STUB / "UnityEngine.cs", STUB / "Driver.cs")


def test_the_images_of_the_mapped_pose_are_uploaded(driver: Path) -> None:
    """And the scene is drawn through the camera of the image."""
    drawn = Renderer()
    with serving(drawn) as where, component(driver, where) as ask:
        pose = wire_pose(IN_UNITY)
        state = stepped(ask, lambda state: drawn.shows(state, pose))
        assert state["problems"] == []
        assert (state["server"][:15], state["size"]) == ("splatbus-server", [WIDTH, HEIGHT])
        assert (state["ipc"], state["message"]) == ("Agreed", "Agreed")
        assert len([each for each in state["logged"] if each.startswith("log: ")]) == 2
        focal = HEIGHT / 2 / math.tan(math.radians(30))
        assert drawn.last.intrinsics == pytest.approx(
            (focal, focal, WIDTH / 2, HEIGHT / 2, 0.25, 500)
        )
        check_matrices(state, drawn.last, 1)
        assert state["_SplatBusMeaning"] == [0, 0, 1, 0]
        assert state["_SplatBusScene"] == [1, 1, 1, 0]

        ask("set unit 2")
        ask("camera 4 2 -8 0 0 0.6 0.8")
        moved = wire_pose("4 2 -8 0 0 0.6 0.8", unit=2)
        state = stepped(ask, lambda state: drawn.shows(state, moved, 0.125))
        assert drawn.last.intrinsics[4:] == pytest.approx((0.125, 250))
        check_matrices(state, drawn.last, 2)
        assert state["_SplatBusScene"][0] == 2

        ask("set followImage false")
        assert stepped(ask, lambda state: True)["view"] == NO_MATRIX
        ask("set compareDepth false")

        def is_depth_spared() -> bool:
            ask(f"camera 0 0 {len(drawn.views)} 0 0 0 1")
            state.update(ask("step"))
            return drawn.last.wants == {"color"}

        assert eventually(is_depth_spared)
        state = ask("step")
        assert state["_SplatBusScene"][1] == 0
        assert state["problems"] == []


def test_images_mean_what_the_server_says_through_a_lens_of_its_own(driver: Path) -> None:
    """Where no lens of the camera can be said."""
    semantics = Semantics("premultiplied", "linear", "ray_distance", depth_empty=9, unit_metres=0.5)
    drawn = Renderer()
    with (
        serving(drawn, semantics=semantics, intrinsics=OFF_THE_MIDDLE) as where,
        component(driver, where, "orthographic", "linear") as ask,
    ):
        pose = wire_pose(IN_UNITY, 0.5)
        state = stepped(ask, lambda state: drawn.shows(state, pose, OFF_THE_MIDDLE.near))
        assert drawn.last.intrinsics == OFF_THE_MIDDLE
        check_matrices(state, drawn.last, 0.5)
        assert state["_SplatBusLens"] == [*OFF_THE_MIDDLE[:4]]
        assert state["_SplatBusSize"][:2] == [WIDTH, HEIGHT]
        assert state["_SplatBusMeaning"] == [1, 1, 0, 9]
        assert state["_SplatBusScene"] == [0.5, 1, 0, 0]
        assert "orthographic" in state["problems"][0]


def test_images_become_as_large_as_the_camera(driver: Path) -> None:
    drawn = Renderer()
    with serving(drawn) as where, component(driver, where) as ask:
        for width, height in ((80, 60), (33, 77)):
            ask(f"screen {width} {height}")
            state = stepped(ask, lambda state: state["size"] == [width, height])  # noqa: B023
            state = stepped(ask, lambda state: drawn.shows(state, wire_pose(IN_UNITY)))
            stepped(ask, lambda _: drawn.last.intrinsics[1] == pytest.approx(focal(height)))  # noqa: B023
            assert drawn.last.intrinsics[0] == pytest.approx(focal(height))
        ask("set fitSize false")
        ask("screen 231 77")
        stepped(ask, lambda _: drawn.last.intrinsics[0] == pytest.approx(focal(77) * 33 / 231))
        assert drawn.last.intrinsics[1] == pytest.approx(focal(77))
        assert state["problems"] == []
        assert not any(each.startswith("warning") for each in state["logged"])


def focal(height: int) -> float:
    """For 60 degrees."""
    return height / 2 / math.tan(math.radians(30))


def test_transforms_move_objects(driver: Path) -> None:
    drawn = Renderer()
    with serving(drawn) as where, component(driver, where) as ask:
        ask("object default 1 2 3 0 0.6 0 0.8 2 2 2")
        state = stepped(ask, lambda _: bool(drawn.views) and drawn.last.placement.scale == 2)
        assert state["problems"] == []
        assert drawn.last.placement.pose == wire_pose("1 2 3 0 0.6 0 0.8")
        ask("object default 1 2 3 0 0.6 0 0.8 3 2 2")
        state = stepped(ask, lambda _: drawn.last.placement.scale == 3)
        assert "along all axes" in state["problems"][0]
        ask("object default 1 2 3 0 0.6 0 0.8 0 0 0")
        assert "OBJ-1" in stepped(ask, lambda state: len(state["problems"]) == 1)["problems"][0]
        for at in (1, 2, 3):
            ask(f"object chair {at} 2 3 0 0.6 0 0.8 1 1 1")
            state = stepped(ask, lambda state: "chair" in str(state["logged"]))
        ask("object table 1 2 3 0 0.6 0 0.8 1 1 1")
        state = stepped(ask, lambda state: "table" in str(state["logged"]))
        assert "unknown_object" in str(state["problems"])
        assert str(state["logged"]).count("chair") == 1


def test_it_says_what_is_wrong(driver: Path) -> None:
    with serving(rendered, token="hush") as where:
        with component(driver, where | {"SPLATBUS_TOKEN": "wrong"}) as ask:
            state = stepped(ask, lambda state: str(state["problems"]).count("unauthorized") == 2)
            assert "hush" not in str(state)
            ask("disable")
            ask("shader none")
            ask("enable")
            assert "shader" in ask("step")["problems"][0]
        with component(driver, where | {"SPLATBUS_TOKEN": "hush"}, "linear") as ask:
            stepped(ask, lambda state: state["message"] == state["ipc"] == "Agreed")
    with component(driver, where) as ask:
        stepped(ask, lambda state: str(state["problems"]).count("ConnectionRefused") == 2)
        ask("disable")
        ask("set ipcPort 70000")
        assert "70000" in ask("enable")["problems"][0]
    with component(driver, where | {"SPLATBUS_MSG_PORT": "many"}) as ask:
        assert "SPLATBUS_MSG_PORT" in ask("step")["problems"][0]


def test_who_waits_for_control_is_told_and_who_has_it_no_more(driver: Path) -> None:
    drawn = Renderer()
    with serving(drawn) as where, component(driver, where) as first:
        stepped(first, lambda state: state["images"] > 0)
        with component(driver, where, "camera 9 9 9 0 0 0 1") as second:
            stepped(second, lambda state: "busy" in str(state["problems"]) and state["images"] > 0)
            first("disable")
            pose = wire_pose("9 9 9 0 0 0 1")
            stepped(second, lambda state: drawn.shows(state, pose) and not state["problems"])


def test_images_are_let_go_with_their_server(driver: Path) -> None:
    """Nothing is drawn through the camera of a server that is gone."""
    with serving(Renderer()) as where:
        view = component(driver, where)
        ask = view.__enter__()
        state = stepped(ask, lambda state: state["images"] > 0)
        assert state["view"] != NO_MATRIX
    state = stepped(ask, lambda state: state["size"] == [0, 0])
    assert state["view"] == state["projection"] == NO_MATRIX
    view.__exit__(None, None, None)


def test_a_refresh_leaves_no_garbage(driver: Path) -> None:
    color, depth = np.full((HEIGHT, WIDTH, 4), 0.5), np.full((HEIGHT, WIDTH), 2.0)
    with (
        serving(lambda _: (color, depth), on_and_on=True) as where,
        component(driver, where | SMALL_NURSERY, "object default 1 2 3 0 0 0 1 1 1 1") as ask,
    ):
        assert ask(f"frames {FRAMES}") == {"collections": 0}


@pytest.mark.apart
def test_the_harness_judges_it_as_a_strangers_client(driver: Path) -> None:
    check_conforms(f"mono {driver}", *SETTING, "enable")
