"""What the compositing graph does to framelets: one small file an operator, a pure function and its description."""
