"""Unit factors: multiply to convert to SI, divide to convert from SI."""

import math

MILLIMETRE = 1e-3
DEGREE = math.pi / 180
PERCENT = 1e-2
GRAM = 1e-3  # kg
MICRO = 1e-6  # microseconds, parts per million
NEWTON_SQUARE_MILLIMETRE = 1e-6  # flexural rigidity, N mm^2 -> N m^2
