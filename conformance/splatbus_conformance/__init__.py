"""The conformance harness: it judges clients from outside."""
