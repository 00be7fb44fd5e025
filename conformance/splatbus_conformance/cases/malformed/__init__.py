"""Messages that break one rule each, and say which."""
