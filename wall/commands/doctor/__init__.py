"""`wall doctor`: what a machine lacks, and how to mend it."""
