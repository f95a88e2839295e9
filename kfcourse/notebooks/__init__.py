"""Exercise notebooks: made from the sets in exercises/, executed, exported, graded."""
