"""Forty-digit values of B and its gradient at some of the points."""

import sys
from importlib.metadata import version

from exact import field, slope
from problems import COMPARED, points_around
from said import measure, say

quantity = field if sys.argv[1] == "field" else slope
points = points_around()[COMPARED]
values, seconds = measure(lambda: [[float(v) for v in quantity(point)] for point in points])
say(values, seconds, len(points), {"mpmath": version("mpmath")})
