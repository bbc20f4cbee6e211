"""Refinement: skin around bent and twisted joints by position-based dynamics, baked or shown live."""
