"""`wall plan`: what a wall needs, and how a run of it would go, before there is one."""
