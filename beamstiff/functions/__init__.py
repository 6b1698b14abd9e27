"""What the commands do, one function a file: robot first, data second, then options by name.

Each takes objects, paths or names of bundled robots, and returns a result whose ``to_dict()`` is what the
command's ``--json`` writes.
"""
