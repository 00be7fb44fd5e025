"""A GPU as a device of the harness: real handles for clients, and its own opener for servers'."""
