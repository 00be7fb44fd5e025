"""The standard, for machines: JSON Schemas, framing and limits as data, and the requirements.

`LIMITS` and `FRAMING` are constants read once; all else is read when asked for. What checks a
message against its schema is in `splatbus_schemas.validation`, which alone imports jsonschema.
"""

from splatbus_schemas.data import (
    FRAMING,
    LIMITS,
    VERSIONS,
    InvalidExample,
    ValidExample,
    examples,
    names,
    read_json,
    schema,
)
from splatbus_schemas.requirements import Requirement, requirements

__all__ = [
    "FRAMING",
    "LIMITS",
    "VERSIONS",
    "InvalidExample",
    "Requirement",
    "ValidExample",
    "examples",
    "names",
    "read_json",
    "requirements",
    "schema",
]
