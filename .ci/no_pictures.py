"""For kernels that execute notebooks again (PYTHONSTARTUP): nbval compares no pictures, so none is
drawn."""

from IPython.core import pylabtools


def _undrawn(drawn):
    from base64 import b64decode

    dot = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="

    def print_figure(figure, fmt="png", base64=False, **options):
        if fmt not in ("png", "retina"):
            return drawn(figure, fmt=fmt, base64=base64, **options)
        return dot if base64 else b64decode(dot)

    return print_figure


pylabtools.print_figure = _undrawn(pylabtools.print_figure)
del pylabtools, _undrawn  # a notebook begins without names
