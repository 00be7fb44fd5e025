"""What a testee asks, is answered and awaits, and what it shows that says nothing."""
