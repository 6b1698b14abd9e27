"""Several causes at once: forward selection with everything that was fitted left open."""
