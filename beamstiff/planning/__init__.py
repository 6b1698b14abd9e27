"""Where to measure: dexterity, the influence of the load on the stiffness, and optimal designs."""
