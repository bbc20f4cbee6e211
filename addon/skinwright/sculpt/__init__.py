"""Sculpting turned into weights: the session, and its replay without a window."""
