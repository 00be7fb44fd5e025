"""The oracle shares no code with what it judges, and has no arithmetic but exact one."""

import ast
import subprocess
import sys
from pathlib import Path

from splatbus_conformance import oracle

ROOT = Path(oracle.__file__).parent
FILES = sorted(ROOT.rglob("*.py"))
JUDGED = (
    "splatbus_wire",
    "splatbus_server",
    "splatbus_renderer",
    "splatbus_splats",
    "splatbus_client",
    "splatbus_viewer",
)


def test_it_works_where_nothing_that_is_judged_can_be_imported():
    places = [file.relative_to(ROOT).with_suffix("").parts for file in FILES]
    modules = [".".join((oracle.__name__, *place)) for place in places if "__" not in place[-1]]
    program = f"""
import importlib, sys
sys.modules.update(dict.fromkeys({JUDGED!r}))
for name in {modules!r}:
    importlib.import_module(name)
from {oracle.__name__}.vectors import projections
print(len(projections.document()["cases"]))
"""
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True
    )
    assert int(ran.stdout) > 50


def imported(file):
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").split(".")[0]


def test_it_takes_no_arithmetic_from_others_but_one_norm():
    outside = {
        (file.name, name)
        for file in FILES
        for name in imported(file)
        if name not in sys.stdlib_module_names
        and name not in ("splatbus_conformance", "splatbus_schemas")
    }
    # NumPy's spectral norm, of deviations that were rounded once; mpmath confirms it.
    assert outside == {("deviation.py", "numpy")}
