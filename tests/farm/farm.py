#!/usr/bin/env python3
"""Tests of farm/: the same film from one process and from each scheduler, with workers that are killed on the way.

Needs `openjd-cli` and `distributed` (PyPI). KDRAY names the command. Slurm is tested by tests/long/slurm.py.
"""

import unittest

from costs import Costs
from schedulers import Schedulers
from parts import Parts
from units import Units

__all__ = ["Costs", "Schedulers", "Parts", "Units"]

if __name__ == "__main__":
    unittest.main()
