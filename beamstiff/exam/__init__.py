"""The exam: machines simulated with a withheld effect, and what a diagnosis says of them."""
