"""Types for other languages, generated from the metamodel: `python -m splatbus_schemas.types`."""
