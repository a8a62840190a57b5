"""Random damage of all files of a dataset: does `verify` name it, does a command use it?"""
