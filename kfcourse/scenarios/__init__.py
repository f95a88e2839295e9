"""Tracks and sensors of the applications.

aircraft     the five-part flight, the radar that follows it, errors by part
pointer      a pointer moved by hand, and the filter that cleans its track
navigation   sensors of any rate, delay and clock, and the filter that fuses them
"""
