"""What only the pages of the book call.

diagram   block diagrams from a description
live      the page on which a reader moves the pointer
house     the structure of this package, read from its imports
"""
