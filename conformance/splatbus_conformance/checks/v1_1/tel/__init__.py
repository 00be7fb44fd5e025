"""Telemetry: TEL."""
