"""Weights kept: named states in the file and in files of their own, restored, compared, exported."""
