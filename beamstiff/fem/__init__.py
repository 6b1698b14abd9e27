"""How the robot deforms: elements, assembly, constraints, condensation, response."""
