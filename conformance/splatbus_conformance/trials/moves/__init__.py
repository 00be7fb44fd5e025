"""What several checks do with a trial: steer, resize, lend, capture, exchange, misbehave."""
