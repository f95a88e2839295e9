"""Grading a folder of returned notebooks.

submissions   what was returned: notebooks, their cells, the exercise each claims to be
assembly      the notebook that is run: the master's, with the student's cells in it
running       a kernel and a folder of its own, with limits of time, memory and output
watch         in that kernel: the exercise as it was handed out
marking       one notebook -> its marks and notes
table         all marks as a CSV table, resumed where it was interrupted
"""
