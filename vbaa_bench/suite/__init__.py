"""Suites: fixed tracks of datasets, their digests, submissions and the leaderboard."""
