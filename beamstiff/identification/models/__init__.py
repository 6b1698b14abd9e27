"""Models whose stiffness varies with the configuration: fuzzy, grid, Gaussian process; compared."""
