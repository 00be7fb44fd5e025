"""The program on each client's page, built as the page says: it runs, and keeps its pace."""

import shlex
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from splatbus_schemas.prose import CHECKOUT

from tests.engines.stage import planes, serving
from tests.guides.pages import blocks

FRAMES, LEAST_SECONDS = 20, 0.01


def test_the_program_of_the_page(language: str, tmp_path: Path) -> None:
    page = blocks(CHECKOUT / "reference_client" / language / "README.md")
    lines = [line for each in page if each.language == "sh" for line in each.text.splitlines()]
    build = shlex.split(next(line for line in lines if "my_viewer.c" in line))
    if not shutil.which(build[0]):
        pytest.skip(f"{build[0]} is not installed")
    text = next(each.text for each in page if each.language == language)
    (tmp_path / build[-1]).write_text(text, "utf-8")
    (tmp_path / "build").mkdir()
    (tmp_path / "reference_client").symlink_to(CHECKOUT / "reference_client")
    subprocess.run(build, cwd=tmp_path, check=True, timeout=120)
    launch = shlex.split(next(line for line in lines if "--launch" in line))[-1]
    with serving(lambda view: planes(view.poses.camera), on_and_on=True) as where:
        pipe = subprocess.PIPE
        run = shlex.split(launch.replace("build/", f"{tmp_path}/build/"))
        with subprocess.Popen(run, env=where, stdout=pipe, text=True) as process:
            assert process.stdout
            images = (line for line in process.stdout if line.startswith("image "))
            next(images)
            began = time.monotonic()
            for _ in range(FRAMES):
                next(images)
            took = time.monotonic() - began
            process.kill()
    assert took > FRAMES * LEAST_SECONDS
