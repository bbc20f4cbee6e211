"""Colours over a mesh: what they show, and how they are drawn."""
