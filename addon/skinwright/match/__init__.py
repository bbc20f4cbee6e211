"""The match of a target while it is looked at and its mask is painted."""
