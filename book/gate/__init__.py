"""The gate of the book: relations that pages type are computed, and a changed letter stops the
build.

tex        formulas as tokens
values     what letters stand for, and how values add and multiply
relation   reads a relation in LaTeX and computes its sides
worlds     numbers for the letters of a page, from definitions in LaTeX
page       what each typed relation of a page is: computed, a definition, quoted, stated
plant      plants changes, and counts what nothing notices
"""
