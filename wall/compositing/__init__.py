"""Pictures from samples: the checked graph of who reconstructs, tiles and shows what."""
