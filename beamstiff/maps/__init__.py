"""Maps of the workspace: stiffness, deflection and dexterity over grids of poses."""
