"""Speed against error: every way to spend rays, compared with a reference picture on a virtual clock."""
