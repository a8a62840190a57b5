"""Live estimation at a real rig: image sources, calibration checks, output and overlays."""
