"""Where the remaining gap is, which effect explains it, how far it shrinks, what to measure next."""
