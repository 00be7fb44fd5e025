"""Init packets: INI (spec 1.0 chapter 4)."""
