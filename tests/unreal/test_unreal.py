"""The Unreal plugin, without Unreal: compiled against a stub, run on it, its shader run as C++."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage
from splatbus_server import Intrinsics, Semantics
from splatbus_wire.poses import Pose

from tests.conformance.images.cuda_stand_in.library import stand_in
from tests.csharp.unity_stub.running import rendered, stepped
from tests.engines import shading
from tests.engines.judging import check_conforms
from tests.engines.stage import HEIGHT, WIDTH, serving
from tests.peers.fake_server import FakeServer
from tests.unreal import building
from tests.unreal.building import MODULE, PLUGIN, SHADERS, headers, sources
from tests.unreal.running import FAR, NEAR, SETTING, Drawn, Eye, check_drawn, view
from tests.waiting import eventually

OFF_THE_MIDDLE = Intrinsics(50.0, 40.0, 20.0, 10.0)
MODULES = {
    "Core": "Containers/Ticker.h CoreMinimal.h HAL/PlatformTime.h Misc/Paths.h"
    " Modules/ModuleManager.h Windows/AllowWindowsPlatformTypes.h"
    " Windows/HideWindowsPlatformTypes.h",
    "DeveloperSettings": "Engine/DeveloperSettings.h",
    "Engine": "Camera/CameraTypes.h Camera/PlayerCameraManager.h Components/ActorComponent.h"
    " Components/SceneComponent.h Engine/GameInstance.h Engine/GameViewportClient.h"
    " Engine/LocalPlayer.h Engine/Texture2D.h Engine/World.h GameFramework/Actor.h"
    " GameFramework/PlayerController.h Kismet/GameplayStatics.h SceneTexturesConfig.h SceneView.h"
    " SceneViewExtension.h Subsystems/GameInstanceSubsystem.h TextureResource.h UnrealClient.h",
    "Projects": "Interfaces/IPluginManager.h",
    "RenderCore": "GlobalShader.h PixelShaderUtils.h RenderGraphBuilder.h RenderGraphUtils.h"
    " RenderingThread.h ShaderCore.h ShaderParameterStruct.h",
    "Renderer": "PostProcess/PostProcessInputs.h",
    "RHI": "DataDrivenShaderPlatformInfo.h RHI.h RHICommandList.h",
}
"""Which module of Unreal has a header, as its documentation says."""


def test_the_plugin_says_what_unreal_needs() -> None:
    said = json.loads((PLUGIN / "SplatBus.uplugin").read_text("utf-8"))
    assert (said["FileVersion"], said["Version"]) == (3, 1)
    assert re.fullmatch(r"\d+\.\d+\.\d+", said["VersionName"])
    for each in ("FriendlyName", "Description", "Category"):
        assert said[each]
    (module,) = said["Modules"]
    # Later, the engine would have compiled its global shaders without ours.
    assert module == {"Name": "SplatBus", "Type": "Runtime", "LoadingPhase": "PostConfigInit"}
    (rules,) = PLUGIN.rglob("*.Build.cs")
    assert rules == MODULE / f"{module['Name']}.Build.cs"
    assert f"class {module['Name']} : ModuleRules" in rules.read_text("utf-8")
    code = "".join(each.read_text("utf-8") for each in sources())
    assert f"IMPLEMENT_MODULE(FSplatBusModule, {module['Name']})" in code


def test_the_rules_name_the_modules_that_the_headers_are_of() -> None:
    rules = (MODULE / "SplatBus.Build.cs").read_text("utf-8")
    public, private = (
        set(re.findall(r'"(\w+)"', found))
        for found in re.findall(r"DependencyModuleNames.AddRange\((.*)\);", rules)
    )
    home = {header: module for module, all_ in MODULES.items() for header in all_.split()}

    def needed(of: list[Path]) -> set[str]:
        includes = (re.findall(r'^#include "(.+?)"', each.read_text("utf-8"), re.M) for each in of)
        named = {each for found in includes for each in found}
        theirs = {each for each in named if not each.lower().startswith("splatbus")}
        assert theirs <= home.keys(), theirs - home.keys()
        return {home[each] for each in theirs}

    # CoreUObject has what the macros of reflection need.
    assert public == needed(list((MODULE / "Public").glob("*.h"))) | {"CoreUObject"}
    assert public | private == needed([*headers(), *sources()]) | {"CoreUObject"}


def test_the_shader_has_the_parameters_that_the_pass_sets() -> None:
    pixel, composite = (
        (SHADERS / f"SplatBus{name}").read_text("utf-8") for name in ("Pixel.ush", "Composite.usf")
    )
    for each in (pixel, composite):
        for opening, closing in ("{}", "()"):
            assert each.count(opening) == each.count(closing)
    declared = re.findall(r"^([\w<>]+) (SplatBus\w+);", pixel + composite, re.M)
    code = (MODULE / "Private" / "SplatBusComposite.cpp").read_text("utf-8")
    kinds = {"FVector4f": "float4", "Texture2D": "Texture2D"}
    bound = re.findall(r"SHADER_PARAMETER(?:_RDG)?(?:_TEXTURE)?\((\w+), (SplatBus\w+)\)", code)
    assert sorted((kind.split("<")[0], name) for kind, name in declared) == sorted(
        (kinds[kind], name) for kind, name in bound
    )
    for _, name in bound:
        assert code.count(f"Parameters->{name} = ") == 1
    ((file, entry),) = re.findall(r'IMPLEMENT_GLOBAL_SHADER\(\w+, "(.+?)", "(\w+)"', code)
    module = (MODULE / "Private" / "SplatBusModule.cpp").read_text("utf-8")
    (virtual,) = re.findall(r'TEXT\("(/Plugin/\w+)"\)', module)
    for each in (file, *re.findall(r'#include "(/Plugin/.+)"', composite)):
        assert (SHADERS.parent / Path(each).relative_to(virtual)).is_file()
    assert f"void {entry}(" in composite


@pytest.fixture(scope="module")
def screen(tmp_path_factory: pytest.TempPathFactory) -> shading.Screen:
    return shading.compiled(tmp_path_factory.mktemp("shader"), SHADERS / "SplatBusPixel.ush", "it")


@pytest.mark.parametrize("alpha", shading.ALPHAS)
@pytest.mark.parametrize("space", shading.SPACES)
@pytest.mark.parametrize("kind", shading.DEPTHS)
def test_the_shader_mixes_as_the_viewer_does(
    alpha: str, space: str, kind: str, screen: shading.Screen
) -> None:
    semantics = Semantics(alpha, space, kind, depth_empty=100.0)
    alphas = shading.check_mixes(screen, semantics, "linear", 250.0, upside_down=False)
    np.testing.assert_array_equal(*alphas)


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return building.driver(tmp_path_factory.mktemp("unreal"))


def focal(width: int) -> float:
    """For 60 degrees, which Unreal has from left to right."""
    return width / 2 / math.tan(math.radians(30))


def test_the_images_of_the_players_camera_are_uploaded(driver: Path) -> None:
    """And the scene is drawn through the camera of the image."""
    drawn = Drawn()
    with serving(drawn) as where, view(driver, where) as ask:
        state = stepped(ask, lambda state: drawn.are_of(state, Eye()))
        assert state["problems"] == []
        assert (state["server"][:15], state["size"]) == ("splatbus-server", [WIDTH, HEIGHT])
        assert (state["ipc"], state["message"]) == ("agreed", "agreed")
        assert len([each for each in state["logged"] if each.startswith("Log: ")]) == 2
        assert drawn.last.intrinsics == pytest.approx(
            (focal(WIDTH), focal(WIDTH), WIDTH / 2, HEIGHT / 2, NEAR / 100, FAR / 100)
        )
        check_drawn(state, drawn.last, 100)
        assert state["lens"] == pytest.approx(drawn.last.intrinsics[:4])
        assert state["pixels"] == [WIDTH, HEIGHT, 0, 0]
        assert state["meaning"] == [0, 0, 1, 0]
        assert state["scene"] == [100, 1, 0, 0]
        assert "color" not in ask("capture")

        seen = len(drawn.views)
        for _ in range(20):
            ask("step")
        assert len(drawn.views) == seen  # nothing is said twice

        ask("set CentimetresPerUnit 50")
        moved = Eye(400, 200, -800, 45, -120, -15)
        ask(moved.command)
        state = stepped(ask, lambda state: drawn.are_of(state, moved, 50))
        check_drawn(state, drawn.last, 50)
        assert state["scene"][0] == 50

        ask("set bFollowImage false")
        ask(Eye().command)
        assert ask("step")["location"] == [*Eye()[:3]]
        ask("set bCompareDepth false")

        def is_depth_spared() -> bool:
            ask(Eye(x=len(drawn.views)).command)
            state.update(ask("step"))
            return bool(drawn.last.wants == {"color"})

        assert eventually(is_depth_spared)
        state = ask("step")
        assert state["scene"][1] == 0
        assert state["problems"] == []


def test_images_mean_what_the_server_says_through_a_lens_of_its_own(driver: Path) -> None:
    """Where no lens of the camera can be said."""
    semantics = Semantics("premultiplied", "linear", "ray_distance", depth_empty=9, unit_metres=0.5)
    drawn = Drawn()
    with (
        serving(drawn, semantics=semantics, intrinsics=OFF_THE_MIDDLE) as where,
        view(driver, where, "orthographic") as ask,
    ):
        near = 50 * OFF_THE_MIDDLE.near
        state = stepped(ask, lambda state: drawn.are_of(state, Eye(), 50, near))
        assert drawn.last.intrinsics == OFF_THE_MIDDLE
        check_drawn(state, drawn.last, 50)
        assert state["lens"] == [*OFF_THE_MIDDLE[:4]]
        assert state["meaning"] == [1, 1, 0, 9]
        assert state["scene"] == [50, 1, 0, 0]
        assert "orthographic" in state["problems"][0]


def test_images_become_as_large_as_the_view(driver: Path) -> None:
    drawn = Drawn()
    with serving(drawn) as where, view(driver, where) as ask:
        for width, height in ((80, 60), (33, 77)):
            ask(f"screen {width} {height}")
            stepped(ask, lambda state: state["size"] == [width, height])  # noqa: B023
            stepped(ask, lambda state: drawn.are_of(state, Eye()))
            stepped(ask, lambda _: drawn.last.intrinsics[0] == pytest.approx(focal(width)))  # noqa: B023
            assert drawn.last.intrinsics[1] == pytest.approx(focal(width))
        ask("set bFitSize false")
        ask("screen 231 77")
        stepped(ask, lambda _: drawn.last.intrinsics[1] == pytest.approx(focal(231)))
        assert drawn.last.intrinsics[0] == pytest.approx(focal(33))
        state = stepped(ask, lambda state: drawn.are_of(state, Eye()))
        check_drawn(state, drawn.last, 100)
        assert state["problems"] == []
        assert not any(each.startswith("Warning") for each in state["logged"])
        ask("set bFitSize true")
        ask("screen 300 60")
        state = stepped(ask, lambda state: state["problems"] != [])
        assert "300 x 60 is more than this GPU takes" in state["problems"][0]


def test_actors_and_components_move_objects(driver: Path) -> None:
    drawn = Drawn()
    with serving(drawn) as where, view(driver, where) as ask:
        turned = "100 200 300 0 0.6 0 0.8"
        ask(f"actor default {turned} 2 2 2")
        state = stepped(ask, lambda _: bool(drawn.views) and drawn.last.placement.scale == 2)
        assert state["problems"] == []
        placed = drawn.last.placement.pose
        assert placed == Pose((2, -3, 1), (-0.6, 0, 0, 0.8))
        ask(f"mover default {turned} 3 2 2")
        state = stepped(ask, lambda _: drawn.last.placement.scale == 3)
        assert "along all axes" in state["problems"][0]
        ask(f"mover default {turned} 0 0 0")
        assert "OBJ-1" in stepped(ask, lambda state: len(state["problems"]) == 1)["problems"][0]
        ask(f"mover chair {turned} 1 1 1")
        state = stepped(ask, lambda state: "chair" in str(state["logged"]))
        assert "unknown_object" in str(state["problems"])


def test_it_says_what_is_wrong(driver: Path) -> None:
    with serving(rendered, token="hush") as where:
        with view(driver, where | {"SPLATBUS_TOKEN": "wrong"}) as ask:
            state = stepped(ask, lambda state: str(state["problems"]).count("unauthorized") == 2)
            assert "hush" not in str(state)
            ask("second")
            assert "another SplatBus View plays" in str(ask("step")["logged"])
        with view(driver, where | {"SPLATBUS_TOKEN": "hush"}) as ask:
            stepped(ask, lambda state: state["message"] == state["ipc"] == "agreed")
    with view(driver, where) as ask:
        stepped(ask, lambda state: str(state["problems"]).count("refused") == 2)
        ask("end")
        ask("set IpcPort 70000")
        assert "70000" in ask("begin")["problems"][0]
    with view(driver, where | {"SPLATBUS_MSG_PORT": "many"}) as ask:
        assert "SPLATBUS_MSG_PORT" in ask("step")["problems"][0]
        ask("end")
        ask("set MessagePort 1")
        ask("begin")
        stepped(ask, lambda state: "refused" in str(state["problems"]))


def test_images_of_1_0_are_not_shown_and_why(driver: Path) -> None:
    server = FakeServer()
    ports = {"IPC": server.ipc_port, "MSG": server.message_port}
    where = {f"SPLATBUS_{name}_PORT": str(port) for name, port in ports.items()}
    with stand_in() as it:
        image = DeviceImage(it.device)
        with view(driver, it.environment() | where) as ask:
            server.ipc().send(image.init_packet())
            state = stepped(ask, lambda state: "what camera" in str(state["problems"]))
            assert state["images"] == 0
    server.stop()


def test_who_waits_for_control_is_told_and_who_has_it_no_more(driver: Path) -> None:
    drawn, elsewhere = Drawn(), Eye(yaw=90)
    with serving(drawn) as where, view(driver, where) as first:
        stepped(first, lambda state: state["images"] > 0)
        with view(driver, where, elsewhere.command) as second:
            stepped(second, lambda state: "busy" in str(state["problems"]) and state["images"] > 0)
            first("end")
            stepped(
                second,
                lambda state: drawn.are_of(state, elsewhere) and not state["problems"],
            )


def test_the_connection_outlives_a_change_of_level(driver: Path) -> None:
    drawn = Drawn()
    with serving(drawn) as where, view(driver, where) as ask:
        stepped(ask, lambda state: drawn.are_of(state, Eye()))
        ask("travel")
        assert "color" not in ask("step")
        ask("begin")
        elsewhere = Eye(yaw=90)
        ask(elsewhere.command)
        state = stepped(ask, lambda state: drawn.are_of(state, elsewhere))
        assert len([each for each in state["logged"] if each.startswith("Log: ")]) == 2


def test_a_view_may_end_before_its_image_is_drawn(driver: Path) -> None:
    """The client waits for the renderer, which reads its memory."""
    with serving(Drawn()) as where, view(driver, where) as ask:
        images = stepped(ask, lambda state: state["images"] > 0)["images"]
        ask(Eye(yaw=90).command)
        assert eventually(lambda: bool(ask("tick")["images"] > images))
        ask("end")
        assert "color" not in ask("step")


def test_images_are_let_go_with_their_server(driver: Path) -> None:
    """Nothing is drawn through the camera of a server that is gone."""
    with serving(Drawn(), intrinsics=OFF_THE_MIDDLE) as where:
        playing = view(driver, where, "orthographic")
        ask = playing.__enter__()
        state = stepped(ask, lambda state: state["images"] > 0)
        assert state["projection"][2] != 0
    stepped(ask, lambda state: state["size"] == [0, 0])
    state = ask("step")
    assert state["projection"][2] == 0
    assert "color" not in state
    playing.__exit__(None, None, None)


@pytest.mark.apart
def test_the_harness_judges_it_as_a_strangers_client(driver: Path) -> None:
    check_conforms(str(driver), *SETTING, "begin")
