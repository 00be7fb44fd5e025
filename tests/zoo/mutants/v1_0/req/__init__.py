"""Requests and replies: REQ (spec 1.0 chapter 6)."""
