"""The test vectors of `spec/vectors`, made by the oracle.

Each module holds the cases of one file. They are written, or checked, by
`python -m splatbus_conformance.oracle.vectors`.
"""
