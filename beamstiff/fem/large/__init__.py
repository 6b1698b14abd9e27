"""Frames of thousands of nodes and more: sparse stiffness, solvers that do not store what they need not."""
