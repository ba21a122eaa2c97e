"""`wall measure live`: what a running wall showed, held against the ideal picture of each moment."""
