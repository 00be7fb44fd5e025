"""What attackers can take from others: a client that behaves, beside each of many attacks."""
