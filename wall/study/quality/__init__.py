"""Speed against error: every way to spend rays, compared with a reference image on a virtual clock."""
