"""Robots for physics simulators: every spring a joint in series, loops cut open and closed by constraints."""
