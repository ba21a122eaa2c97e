"""Hard cases of numerical accuracy: each has a figure, a bound, and the reason for it."""
