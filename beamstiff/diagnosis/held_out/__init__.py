"""What the causes explain of held-out postures."""
