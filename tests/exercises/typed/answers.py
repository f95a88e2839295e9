"""What is tested of the answers typed in a file of this folder: its lists RIGHT, WRONG and UNUSABLE, a test for each row."""

# Hints that say where an answer is right, or how it stands to the right one: each is found by the values themselves.
BY_VALUE = {"limit", "power", "exchanged", "entry", "rows", "columns", "components", "off-diagonal", "terms", "shifted"}
BY_VALUE |= {"one-for-all", "mixed", "diagonal", "factor", "term", "too-large", "too-small", "vanishing"}
ROWS = {
    "test_right_answers_pass": ("RIGHT", ("name", "answer")),
    "test_no_wrong_kind_of_mistake_is_named": ("WRONG", ("name", "kinds", "answer")),
    "test_what_cannot_be_compared_is_explained": ("UNUSABLE", ("name", "words", "answer")),
}


def test_right_answers_pass(told, name, answer):
    assert told(name, answer).passed


def test_no_wrong_kind_of_mistake_is_named(told, name, kinds, answer):
    """`kinds`: all names that are true of the mistake, of which at least one is said; none where none is expected."""
    result = told(name, answer)
    said, true = set(result.diagnosis), set(kinds.split())
    assert result.status == "wrong"
    assert said - BY_VALUE <= true, result
    assert said & true or not kinds, result


def test_what_cannot_be_compared_is_explained(told, name, words, answer):
    result = told(name, answer)
    assert result.status == "unusable"
    assert words in result.message
