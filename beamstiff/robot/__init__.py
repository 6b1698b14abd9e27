"""What the robot is: its description, graph and kinematics."""
