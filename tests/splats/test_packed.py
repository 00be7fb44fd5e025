"""Formats that pack Gaussians: the same picture, and a broken file ends no more than its reader."""

from __future__ import annotations

import json
import re
import zipfile
from pathlib import Path

import gaussforge
import numpy as np
import pygltflib
import pytest
from splatbus_splats.files import gltf, packed, ply
from splatbus_splats.files.read import read
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.shots import cloud, drawn, view_of

WORST = {
    "a.spz": 0.005,
    "a.sog": 0.001,
    "a.ksplat": 0.001,
    "a.compressed.ply": 0.02,
    "a.glb": 1e-6,
    "a.gltf": 1e-6,
}
"""What they may round, on the average of a picture; upside down it is off by 0.07."""
SCENE = cloud(3000)
NEAR = SCENE[np.linalg.norm(SCENE.means, axis=1) < 8]


def in_gltf(scales: np.ndarray = NEAR.scales, **node: object) -> pygltflib.GLTF2:
    """NEAR, in one node."""
    names = [f"SH_DEGREE_{d}_COEF_{n}" for d in range(4) for n in range(2 * d + 1)]
    names = [f"{gltf.EXTENSION}:{each}" for each in (*gltf.NAMES, *names)]
    bands = NEAR.coefficients.swapaxes(0, 1)
    columns = [NEAR.means, NEAR.rotations, scales, NEAR.opacities[:, None], *bands]
    kinds = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
    starts = np.cumsum([0, *(each.nbytes for each in columns)]).tolist()
    attributes = dict(zip(("POSITION", *names), range(len(columns)), strict=True))
    splats = {"attributes": attributes, "mode": 0, "extensions": {gltf.EXTENSION: {}}}
    document = {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **node}],
        "meshes": [{"primitives": [splats]}],
        "accessors": [
            {"bufferView": i, "componentType": 5126, "count": len(it), "type": kinds[it.shape[1]]}
            for i, it in enumerate(columns)
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": each.nbytes}
            for start, each in zip(starts, columns, strict=False)
        ],
        "buffers": [{"byteLength": starts[-1]}],
    }
    model = pygltflib.GLTF2.from_json(json.dumps(document), infer_missing=True)
    model.set_binary_blob(b"".join(each.tobytes() for each in columns))
    return model


def written(path: Path, count: int = len(NEAR)) -> Path:
    if path.suffix in (".glb", ".gltf"):
        model = in_gltf()
        if path.suffix == ".gltf":
            model.convert_buffers(pygltflib.BufferFormat.DATAURI)
        model.save(str(path))
        return path
    plain = path.with_name("plain.ply")
    ply.write(plain, NEAR[:count])
    kind = packed.FORMATS.get(path.suffix, packed.COMPRESSED)
    made = gaussforge.GaussForge().convert(plain.read_bytes(), "ply", kind)
    path.write_bytes(made["data"])
    return path


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("name", WORST)
def test_the_picture_is_the_same(name: str, tmp_path: Path) -> None:
    path = written(tmp_path / name)
    found, left_out, motion, doubts, origin, _ = read(path, origin=None)
    assert (len(found), left_out, motion, doubts) == (len(NEAR), {}, None, ())
    assert not any(origin)
    image, wanted = (drawn(view_of(), {"default": each}).color for each in (found, NEAR))
    assert np.abs(image - wanted).mean() < WORST[name]


@pytest.mark.parametrize("name", WORST)
@pytest.mark.parametrize("kept", [0.02, 0.6, 0.999])
def test_what_is_cut_short_is_refused_or_less(name: str, kept: float, tmp_path: Path) -> None:
    path = written(tmp_path / name, 64)
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    try:
        assert len(read(path).gaussians) <= len(NEAR)
    except ValueError as error:
        assert str(error).startswith(f"{path}: ")  # noqa: PT017


def test_a_reader_that_dies_is_told(tmp_path: Path) -> None:
    """Of a count that is not true it reads beyond what there is."""
    path, false = written(tmp_path / "a.sog", 64), tmp_path / "false.sog"
    with zipfile.ZipFile(path) as whole, zipfile.ZipFile(false, "w") as broken:
        for name in whole.namelist():
            lying = re.sub(rb'"count": ?64', b'"count":10000000', whole.read(name))
            broken.writestr(name, lying)
    with pytest.raises(
        ValueError, match=r"this .sog file cannot be read: it is broken: what reads it"
    ):
        read(false)


def test_what_takes_too_long_or_is_not_installed_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "a.spz", 64)
    monkeypatch.setattr(packed, "MOST_SECONDS", 0.001)
    with pytest.raises(ValueError, match=r"a.spz: it takes longer than 0.001 s"):
        read(path)
    monkeypatch.setattr(packed, "find_spec", lambda _: None)
    with pytest.raises(ImportError, match=r"a.spz: .spz is read by gaussforge, which is not"):
        read(path)


@pytest.mark.usefixtures("loops")
def test_a_node_of_a_gltf_places_its_gaussians(tmp_path: Path) -> None:
    """As an object is placed, colours that depend on the view included; logarithms are scales of
    drafts.
    """
    turn = (0.1, -0.3, 0.2, 0.9273618495)
    model = in_gltf(np.log(NEAR.scales), rotation=turn, translation=[0.3, -0.2, 1], scale=[1.5] * 3)
    model.save(str(tmp_path / "a.glb"))
    view = view_of(IDENTITY, Placement("default", Pose((0.3, -0.2, 1.0), turn), 1.5))
    splats = read(tmp_path / "a.glb")
    assert splats.up == "y"
    found = drawn(view_of(), {"default": splats.gaussians}).color
    np.testing.assert_allclose(found, drawn(view, {"default": NEAR}).color, atol=2e-6)


def test_a_node_may_move_them_as_far_as_a_map_does(tmp_path: Path) -> None:
    far = np.array([5e5, 5e5, 4e6])
    in_gltf(translation=far.tolist()).save(str(tmp_path / "a.glb"))
    splats = read(tmp_path / "a.glb", origin=None)
    assert np.abs(splats.origin - far).max() < 10
    found = splats.gaussians.means + (splats.origin - far)
    np.testing.assert_allclose(found, NEAR.means, atol=2e-6)


BROKEN = {
    "scales their axes unevenly": lambda it: it.nodes[0].scale.__setitem__(0, 2.0),
    "it is a mesh": lambda it: it.meshes[0].primitives[0].extensions.clear(),
    "it has no attribute POSITION": lambda it: vars(it.meshes[0].primitives[0].attributes).pop(
        "POSITION"
    ),
    "/accessors/2 reaches beyond its buffer": lambda it: setattr(it.accessors[2], "count", 1 << 40),
    "/accessors/0 is sparse": lambda it: setattr(it.accessors[0], "bufferView", None),
}


@pytest.mark.parametrize("told", BROKEN)
def test_a_gltf_that_is_not_read_is_told_why(told: str, tmp_path: Path) -> None:
    model = in_gltf(scale=[1.0, 1.0, 1.0])
    BROKEN[told](model)
    model.save(str(tmp_path / "a.glb"))
    with pytest.raises(ValueError, match=rf"a.glb: this glTF file cannot be read: .*{told}"):
        read(tmp_path / "a.glb")
