"""Geometry, and compliances along with it, from measured absolute positions or poses."""
