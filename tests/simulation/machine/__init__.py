"""What stands in for the system: time, network, memory. It knows nothing of the protocol."""
