"""How many threads a process of the rig uses for its arithmetic."""

import os


def use_one_thread() -> None:
    """Keep numpy's linear algebra to one thread, unless the environment says otherwise.

    Processes that run side by side share the host's cores: libraries that start a thread for each
    core, and let them spin, take the time from each other. And sums are rounded alike wherever
    they are computed. Call it before numpy is imported, which reads it once.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
