"""What fits the model to measurements, with its uncertainty and what cannot be known."""
