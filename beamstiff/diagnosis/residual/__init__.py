"""The residual of the fitted model: in units of its noise, its repeats, its gross errors."""
