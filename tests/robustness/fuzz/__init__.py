"""Fuzzing: random mistakes in every kind of input, each case in a watched child process."""
