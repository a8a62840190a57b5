"""Endurance of dataset runs: killed processes, full disks, lost machines, long runs."""
