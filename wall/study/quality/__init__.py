"""Speed against error: every way to spend rays, compared with an ideal picture on a virtual clock."""
