"""Negotiation, errors and tokens: NEG."""
