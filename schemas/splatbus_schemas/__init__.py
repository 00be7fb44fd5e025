"""The standard, for machines: JSON Schemas, framing and limits as data."""
