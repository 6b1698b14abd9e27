"""What to measure next: the states that distinguish the likeliest causes."""
