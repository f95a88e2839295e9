"""Grading a folder of returned notebooks.

submissions   what was returned: notebooks, their cells, the exercise each claims to be
assembly      the cells that are run: the master's, with the student's in them
session       in a notebook's process: runs cells, calls functions, knows no answers
values        what may leave that process: numbers, arrays, formulas, as JSON
channel       messages between processes
staging       the package without the right answers, for that process
sandbox       where that process runs: in bubblewrap, or with all rights
running       its cells and answers, with limits of time and memory
asking        arguments of the grader's own
marking       one notebook -> its marks and notes
pool          processes that grade, started anew when one ends
owners        whose notebook it is, and what to look at
weights       what an answer is worth
report        tables and pages for students and lecturers
results       grades as lines of JSON, and their table
course        from the folder to table, report and screen
"""
