"""Ways to minimise, one file a library or idea; each has a function `run`."""
