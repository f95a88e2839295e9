"""Files appear complete or not at all."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

from kfcourse.files import replacing


def test_two_threads_write_the_same_file(tmp_path):
    """As two batches of a comparison do that are the first to need a compiled model."""
    target, together = tmp_path / "law.py", Barrier(2)

    def write(text):
        with replacing(target) as path:
            path.write_text(text)
            together.wait(60)

    with ThreadPoolExecutor(2) as pool:
        assert [*pool.map(write, ["x = 1", "x = 2"])] == [None, None]
    assert target.read_text() in ("x = 1", "x = 2")
    assert [*tmp_path.iterdir()] == [target]
