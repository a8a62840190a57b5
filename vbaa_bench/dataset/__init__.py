"""A dataset on disk: observations/ for solvers and truth/ for scoring, joined by frame id."""
