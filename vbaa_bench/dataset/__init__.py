"""A dataset on disk: observations/ for solvers, truth/ for the judge, joined by frame id."""
