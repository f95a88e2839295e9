"""Constants of the exact filter that more than one of its files uses; those of one file stand there."""

import numpy as np

WIDTH = 8.0  # sigmas covered: 1e-15 of a normal law lies outside
NEGLIGIBLE = 1e-14  # mass that may be left out
TAIL = 1e-18  # mass at a node beyond which a density has ended
LOWEST = 700.0  # exponentials of -LOWEST and less are nothing; NumPy takes ten times as long for those that underflow
TOLERABLE = 1e-2  # error of a step, in standard deviations, that no way resolves better, before the filter gives up
SHARP = 1e300  # the density of a point
ROOT = np.sqrt(2 * np.pi)

LOOKED = 25  # nodes of a first look at a density
NODES = (33, 49, 65, 97, 129, 193, 257)  # that a posterior may have
SPACINGS = (0.5, 0.35, 0.25, 0.18, 0.12)  # of these at the highest hump, in its widths, tried one after the other
MORE = 1.9  # times more nodes than did not do
FEW = 6144  # nodes with which a sum of kernels is cheaper than the integral over the noise

ELEMENTS = 2**20  # of the largest array: 8 MB
CACHED = 2**15  # elements of an array that stays in the processor's cache: 256 kB
