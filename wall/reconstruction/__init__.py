"""Images from the samples of a deep buffer."""
