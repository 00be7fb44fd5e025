"""NumPy without its types, which take a type checker longer than all else together.

For the steps that look for what a system or an old Python lacks (`tests/__main__.py`).
"""

from typing import Any

def __getattr__(name: str) -> Any: ...
