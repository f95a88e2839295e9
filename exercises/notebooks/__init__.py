"""Exercise notebooks.

master         statement.md -> the complete notebook, the student's, the book's page
nbgrader       the same in nbgrader's format
written_code   formulas as the code of a solution
execution      a notebook in a kernel of its own; pictures, checks, HTML, PDF
kernels        kernels that need not import the libraries: forks of a process that has
jobs           every set for every variant, in parallel, resumed
handing_out    which of them are wanted, and a line on the screen for each folder
course_list    a variant for each student
texts          names and words of other people: in paths, on terminals, in spreadsheets
"""
