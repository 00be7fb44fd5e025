"""What buffers hold: BUF (spec 1.0 chapter 4)."""
