"""Messages that break no rule and are hard to take, or unusual."""
