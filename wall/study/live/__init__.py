"""`wall measure live`: what a running wall showed, held against the reference image of each moment."""
