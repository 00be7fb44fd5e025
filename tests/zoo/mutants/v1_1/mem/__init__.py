"""Memory of the host: MEM."""
