"""Tracks and sensors of the applications.

carrier      a carrier of unknown phase
flight       the five-part flight of an aircraft
radar        what a radar measures of it, and the models that track it
tracking     the Kalman filter of the radar chapters, with a control made of the measurements or
             without
errors       errors by part of the flight
ballistic    a body thrown into the air, and the radar that sees it
irregular    a track in the plane at unequal intervals, with gaps and gross errors
pointer      a pointer moved by hand, and the filter that cleans its track
benchmarks   models on which the field compares its filters, with published figures
drive        a recorded drive: receiver and gyroscope, no truth
navigation   sensors of any rate, delay and clock, and the filter that fuses them
"""
