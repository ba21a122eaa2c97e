"""From samples to pictures."""
