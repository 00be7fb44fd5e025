"""The oracle has no arithmetic but exact one; that it shares no code with what it judges, the
contracts of imports hold.
"""

import ast
import sys
from pathlib import Path

from splatbus_conformance import oracle


def imported(file):
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        names = node.names if isinstance(node, ast.Import) else ()
        yield from (alias.name.split(".")[0] for alias in names)
        if isinstance(node, ast.ImportFrom):
            yield (node.module or "").split(".")[0]


def test_it_takes_no_arithmetic_from_others_but_one_norm():
    known = {*sys.stdlib_module_names, "splatbus_conformance", "splatbus_schemas"}
    files = Path(oracle.__file__).parent.rglob("*.py")
    outside = {(file.name, name) for file in files for name in imported(file) if name not in known}
    # NumPy's spectral norm, of deviations that were rounded once; mpmath confirms it.
    assert outside == {("deviation.py", "numpy")}
