"""Extract a sub-pixel centreline from an image, with a sigma for every point."""

from solver.instrument.centreline import Centreline as Centreline
from solver.instrument.centreline import Flag as Flag
from solver.instrument.centreline import down_columns as down_columns
