"""Generation of a dataset: images with readings and truth, by workers that may die."""
