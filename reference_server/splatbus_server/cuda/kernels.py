"""The kernels of publish.cu, compiled for a device and a source's format when first asked for."""

from __future__ import annotations

from importlib.resources import files
from typing import Any, NamedTuple

from splatbus_server.cuda.driver import CudaError, api, call

try:
    from cuda.bindings import nvrtc  # type: ignore[import-not-found,unused-ignore]
except ImportError as problem:  # pragma: no cover
    raise ImportError("memory on a GPU needs cuda-bindings with NVRTC") from problem

THREADS = 128
"""In a block; each takes a pixel."""


class Format(NamedTuple):
    """What the source's numbers are: what the kernels are compiled for.

    Attributes:
        channels: of colour, 3 or 4.
        color_half: whether colour is float16, not float32.
        packed: whether a pixel's four channels are one aligned vector.
        depth: 0 none, 1 z, 2 Σ(1/zᵢ)αᵢTᵢ, 3 Σzᵢαᵢ Tᵢ.
        depth_half: as `color_half`.
        alpha: whether there is a plane of it, beside the colour's fourth channel.
        alpha_half: as `color_half`.
        premultiplied: whether the colour is multiplied by alpha.
    """

    channels: int
    color_half: bool
    packed: bool
    depth: int
    depth_half: bool
    alpha: bool
    alpha_half: bool
    premultiplied: bool


class Kernels(NamedTuple):
    """For one format; what each writes is in its name. `legacy` writes straight alpha always."""

    color_depth: Any
    color_only: Any
    depth_only: Any
    legacy: Any


class Compiler:
    """Compiles for one device, whose context is current when it is called; keeps what it has."""

    def __init__(self, capability: tuple[int, int]) -> None:
        self._capability = capability
        self._kept: dict[Format, Kernels] = {}

    def kernels(self, wanted: Format) -> Kernels:
        """The kernels for a format: at once, but for the first time.

        Raises:
            CudaError: NVRTC is missing or refuses.
        """
        found = self._kept.get(wanted)
        if found is None:
            found = self._kept[wanted] = self._compiled(wanted)
        return found

    def _compiled(self, wanted: Format) -> Kernels:
        macros = {name.upper(): int(value) for name, value in wanted._asdict().items()}
        macros["THREADS"] = THREADS
        source = files(__package__).joinpath("publish.cu").read_text("utf-8")
        module = call(api.cuModuleLoadData, compiled(source, macros, self._capability))
        return Kernels(
            *(call(api.cuModuleGetFunction, module, name.encode()) for name in Kernels._fields)
        )


def compiled(source: str, macros: dict[str, int], capability: tuple[int, int]) -> bytes:
    """Machine code of CUDA C++ for a device; PTX where NVRTC is older than the device.

    Args:
        source: of the program.
        macros: names and their values.
        capability: of the device.

    Raises:
        CudaError: NVRTC is missing, or the source is wrong: with its log.
    """
    try:
        known: list[int] = _nvrtc(nvrtc.nvrtcGetSupportedArchs)
    except CudaError:
        raise
    except Exception as problem:  # of cuda.pathfinder: its type differs between versions
        raise CudaError(f"NVRTC, which compiles the kernel, is missing: {problem}") from None
    number = 10 * capability[0] + capability[1]
    native = number in known
    target = f"sm_{number}" if native else f"compute_{max(a for a in known if a <= number)}"
    options = [f"--gpu-architecture={target}", "--std=c++17"]
    options += [f"-D{name}={value}" for name, value in macros.items()]
    program = _nvrtc(nvrtc.nvrtcCreateProgram, source.encode(), b"publish.cu", 0, [], [])
    try:
        encoded = [option.encode() for option in options]
        status = nvrtc.nvrtcCompileProgram(program, len(encoded), encoded)[0]
        if status:
            log = b" " * _nvrtc(nvrtc.nvrtcGetProgramLogSize, program)
            _nvrtc(nvrtc.nvrtcGetProgramLog, program, log)
            raise CudaError(f"NVRTC refuses the kernel: {log.decode(errors='replace')}")
        get_size, get = (
            (nvrtc.nvrtcGetCUBINSize, nvrtc.nvrtcGetCUBIN)
            if native
            else (nvrtc.nvrtcGetPTXSize, nvrtc.nvrtcGetPTX)
        )
        code: bytes = b" " * _nvrtc(get_size, program)
        _nvrtc(get, program, code)
        return code
    finally:
        nvrtc.nvrtcDestroyProgram(program)


def _nvrtc(function: Any, *arguments: Any) -> Any:
    status, *results = function(*arguments)
    if status:
        raise CudaError(f"{function.__name__}: {status.name}")
    return results[0] if len(results) == 1 else tuple(results)
