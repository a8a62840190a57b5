"""Generation of a dataset: plan of the pushes, images with readings and truth, workers."""
