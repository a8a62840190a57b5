"""Planes of the antenna: the calibration plane C, the deformation plane D, and their sag."""
