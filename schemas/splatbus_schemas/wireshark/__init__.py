"""A dissector for Wireshark, made of the metamodel."""
