"""Formats that pack Gaussians: the same picture, and a broken file ends no more than its reader."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import gaussforge
import numpy as np
import pytest
from splatbus_splats.files import packed, ply
from splatbus_splats.files.read import met, read

from tests.splats.shots import cloud, drawn, view_of

WORST = {"a.spz": 0.005, "a.sog": 0.001, "a.ksplat": 0.001, "a.compressed.ply": 0.02}
"""What they may round, on the average of a picture; upside down it is off by 0.07."""
SCENE = cloud(3000)
NEAR = SCENE[np.linalg.norm(SCENE.means, axis=1) < 8]


def written(path: Path, count: int = len(NEAR)) -> Path:
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
    found, left_out, motion, doubts = read(path)
    assert (len(found), left_out, motion, doubts) == (len(NEAR), {}, None, ())
    assert not any(met(path).origin)
    image, wanted = (drawn(view_of(), {"default": each}).color for each in (found, NEAR))
    assert np.abs(image - wanted).mean() < WORST[name]


@pytest.mark.parametrize("name", WORST)
@pytest.mark.parametrize("kept", [0.02, 0.6, 0.999])
def test_what_is_cut_short_is_refused_or_less(name: str, kept: float, tmp_path: Path) -> None:
    path = written(tmp_path / name, 64)
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    try:
        assert len(read(path).gaussians) <= 64
    except ValueError as error:
        assert str(error).startswith(f"{path}: ")  # noqa: PT017


def test_a_reader_that_dies_is_told(tmp_path: Path) -> None:
    """Of a count that is not true it reads beyond what there is."""
    path, false = written(tmp_path / "a.sog", 64), tmp_path / "false.sog"
    with zipfile.ZipFile(path) as whole, zipfile.ZipFile(false, "w") as broken:
        for name in whole.namelist():
            lying = re.sub(rb'"count": ?64', b'"count":10000000', whole.read(name))
            broken.writestr(name, lying)
    with pytest.raises(ValueError, match=r"no .sog that can be read: it is broken: what reads it"):
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
