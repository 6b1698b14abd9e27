"""How well every hypothesis explains the residual: evidence, component subspaces, pairs, linearisation."""
