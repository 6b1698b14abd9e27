"""From evidence to a verdict, and to the places where the gap is."""
