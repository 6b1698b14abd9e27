"""What predicts: displacement of the measured points from joint values and wrench, with exact derivatives."""
