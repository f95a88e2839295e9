"""Exercise notebooks: made from the masters in exercises/, executed, exported, graded."""
