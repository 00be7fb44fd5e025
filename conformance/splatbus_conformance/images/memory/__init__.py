"""Where images lie: shared memory of the host and of devices, and who reads it."""
