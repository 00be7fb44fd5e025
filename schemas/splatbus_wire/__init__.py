"""The standard, spoken by Python: framing, messages, poses, conventions, depth. Sans-I/O."""
