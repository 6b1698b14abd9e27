"""Straight-line programs: scalar arithmetic written down once, then run over many poses at a stretch."""
