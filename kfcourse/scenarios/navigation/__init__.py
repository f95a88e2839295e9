"""Integrated navigation: several sensors, each with its own meter, rate, delay and time scale, and
one filter.

    dx = (A x + B u) dt + dW,     y = b(x(t_j), w_j)   at the moments t_j of the sensor's own

Dynamics, Inputs, Path    the motion, and its exact transition over any interval
Sensor, Clock, observe    what the sensors say of it: a list of `Observation`, in the order of
                          arrival
fuse                      the filter: each measurement is used at its moment of capture, however
                          late it comes

Chapters "Integration of sensors" and "Rates and time tags" of the book; lecture 12.
"""

from kfcourse.scenarios.navigation.dynamics import Dynamics, Inputs, Path, Transition, sample
from kfcourse.scenarios.navigation.fusion import fuse
from kfcourse.scenarios.navigation.sensors import Clock, Observation, Sensor, observe

__all__ = [
    "Clock",
    "Dynamics",
    "Inputs",
    "Observation",
    "Path",
    "Sensor",
    "Transition",
    "fuse",
    "observe",
    "sample",
]
