"""What shows results to people: figures, and files written whole or not at all."""
