"""Opening of memory and its generations: OPN."""
